//! The six-switch bridge in detail: dead time, on-resistance, diodes, open and shorted switches, open phases.
//!
//! A leg is high, low or off. Off, its diodes conduct by the sign of the phase current; at zero current the
//! phase floats until its terminal voltage v_n + e_j leaves the rails. The neutral voltage sums the
//! connected phases only. A shorted switch whose partner is gated shoots through: the drive trips.
//!
//! Dead time need not be whole steps: in the step in which a switch closes, its leg has the mean of diode and switch
//! over the step. The volt-seconds are exact for a current that keeps its sign within the step; a leg without current
//! has no diode to follow and is given to its switch at once.

mod circuit;
mod pulses;

pub use self::circuit::{Circuit, Windings};
pub use self::pulses::Pulses;

use crate::kept;
use crate::scalar::Scalar;
use crate::three;
use crate::variable::acts::{Fidelity, When};
use crate::variable::View;
use crate::variables;

/// The bridge is without gates at some time.
const GATELESS: When = When::Either(&[
    When::Chosen("drive.kind", &["off"]),
    When::Away("inverter.trip_current", 0.0),
    When::Away("inverter.shorted_a_high", 0.0),
    When::Away("inverter.shorted_a_low", 0.0),
    When::Away("inverter.shorted_b_high", 0.0),
    When::Away("inverter.shorted_b_low", 0.0),
    When::Away("inverter.shorted_c_high", 0.0),
    When::Away("inverter.shorted_c_low", 0.0),
    When::In(Fidelity::Low, &[When::Away("sensor.resolver.power_off", 0.0), When::Chosen("drive.feedback_loss", &["stop"])]),
]);

variables! {
    /// The bridge and its supply.
    InverterParameter, INVERTER {
        SupplyVoltage => "supply_voltage", "V_dc", "V", Positive, Plant, None, "DC link voltage, unless the scenario drives it";
        SupplyScale => "supply_scale", "-", "1", Unit, Plant, Some(1.0), "healthy 1; less: the supply sags";
        HysteresisBand => "hysteresis_band", "h", "A", Positive, Controller, Some(0.5), "half band of the relays around the commanded phase current",
            when(&[Chosen("drive.kind", &["hysteresis"])]);
        OnResistance => "on_resistance", "R_on", "ohm", NonNegative, Plant, Some(0.0), "resistance of a conducting switch",
            when(&[In(Low, &[GATELESS])]);
        DiodeDrop => "diode_drop", "V_d", "V", NonNegative, Plant, Some(0.0), "forward voltage of a free-wheeling diode",
            when(&[In(Low, &[GATELESS])]);
        DeadTime => "dead_time", "t_d", "s", NonNegative, Plant, Some(0.0), "both switches of a leg are off for this time at each transition",
            when(&[In(Low, &[Chosen("drive.kind", &["pwm"])])]);
        TripCurrent => "trip_current", "I_trip", "A", NonNegative, Controller, Some(0.0), "the drive trips when a phase current exceeds it; 0: no over-current trip";
        OpenAHigh => "open_a_high", "-", "1", Flag, Plant, Some(0.0), "1: the upper switch of leg a never closes",
            high_only("half waves of one phase are missing: its one phase has none");
        OpenALow => "open_a_low", "-", "1", Flag, Plant, Some(0.0), "1: the lower switch of leg a never closes",
            high_only("half waves of one phase are missing: its one phase has none");
        OpenBHigh => "open_b_high", "-", "1", Flag, Plant, Some(0.0), "1: the upper switch of leg b never closes",
            high_only("half waves of one phase are missing: its one phase has none");
        OpenBLow => "open_b_low", "-", "1", Flag, Plant, Some(0.0), "1: the lower switch of leg b never closes",
            high_only("half waves of one phase are missing: its one phase has none");
        OpenCHigh => "open_c_high", "-", "1", Flag, Plant, Some(0.0), "1: the upper switch of leg c never closes",
            high_only("half waves of one phase are missing: its one phase has none");
        OpenCLow => "open_c_low", "-", "1", Flag, Plant, Some(0.0), "1: the lower switch of leg c never closes",
            high_only("half waves of one phase are missing: its one phase has none");
        ShortedAHigh => "shorted_a_high", "-", "1", Flag, Plant, Some(0.0), "1: the upper switch of leg a is always closed";
        ShortedALow => "shorted_a_low", "-", "1", Flag, Plant, Some(0.0), "1: the lower switch of leg a is always closed";
        ShortedBHigh => "shorted_b_high", "-", "1", Flag, Plant, Some(0.0), "1: the upper switch of leg b is always closed";
        ShortedBLow => "shorted_b_low", "-", "1", Flag, Plant, Some(0.0), "1: the lower switch of leg b is always closed";
        ShortedCHigh => "shorted_c_high", "-", "1", Flag, Plant, Some(0.0), "1: the upper switch of leg c is always closed";
        ShortedCLow => "shorted_c_low", "-", "1", Flag, Plant, Some(0.0), "1: the lower switch of leg c is always closed";
    }
}

impl InverterParameter {
    /// Any of these away from zero needs the detailed bridge.
    pub const DETAIL: std::ops::RangeInclusive<usize> = Self::OnResistance as usize..=Self::ShortedCLow as usize;
}

/// Constants of the detailed bridge.
#[derive(Clone, Copy, Debug)]
pub struct Bridge<S> {
    pub on_resistance: S,
    diode_drop: S,
    dead_time: S,
    trip_current: S,
    open: [[S; 2]; 3],
    shorted: [[S; 2]; 3],
}

#[derive(Clone, Copy, Debug)]
pub struct BridgeState<S> {
    /// Time left at the end of the last step before the newly commanded switch closes.
    blanking: [S; 3],
    /// 1 once the drive has tripped: no gate signals any more.
    pub tripped: S,
}

kept!(BridgeState<f64> as BridgeState { blanking, tripped });

/// The electrical condition of the three legs during one step.
#[derive(Clone, Copy, Debug)]
pub struct Legs<S: Scalar> {
    /// Terminal voltage against the middle of the link; meaningless where not connected.
    pub voltage: [S; 3],
    /// The rail a connected leg draws its current from (+-V/2), for the energy account.
    pub rail: [S; 3],
    /// The phase carries or may carry current.
    pub connected: [S::Mask; 3],
    /// No switch holds the leg: its current may only fall to zero.
    pub passive: [S::Mask; 3],
}

/// What of the bridge a run can need beyond switches and dead time; equal over a lane block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct BridgeStructure {
    /// Some switch is open or shorted at some time.
    pub switch_faults: bool,
    /// Some phase is interrupted at some time.
    pub open_phases: bool,
    /// Something may trip the drive.
    pub trips: bool,
}

impl BridgeStructure {
    pub fn read(view: &View<InverterParameter>, open_phases: bool) -> Self {
        use InverterParameter as P;
        let switch_faults = view.any_away_among(P::OpenAHigh, P::ShortedCLow);
        Self { switch_faults, open_phases, trips: switch_faults || view.away(P::TripCurrent) }
    }

    /// The same where something else may trip the drive, too.
    pub fn with_trips(self, more: bool) -> Self {
        Self { trips: self.trips || more, ..self }
    }

    /// Of a bridge that is looked at without gates only: switches that never close are then like any other.
    pub fn gateless(view: &View<InverterParameter>) -> Self {
        use InverterParameter as P;
        let switch_faults = view.any_away_among(P::ShortedAHigh, P::ShortedCLow);
        Self { switch_faults, open_phases: true, trips: switch_faults || view.away(P::TripCurrent) }
    }
}

/// Has the bridge more than ideal switches?
pub fn detailed(view: &View<InverterParameter>) -> bool {
    view.any_away_among(InverterParameter::OnResistance, InverterParameter::ShortedCLow)
}

/// The legs of one step, and the neutral voltage where some leg is loose.
#[derive(Clone, Copy)]
pub struct Connection<S: Scalar> {
    pub legs: Legs<S>,
    pub loose: Option<S>,
}

impl<S: Scalar> Bridge<S> {
    pub fn derive(raw: &[S]) -> Self {
        use InverterParameter as P;
        let g = |p: P| raw[p as usize];
        let pairs = |first: P| -> [[S; 2]; 3] { three!(|j| std::array::from_fn(|i| raw[first as usize + 2 * j + i])) };
        Self {
            on_resistance: g(P::OnResistance),
            diode_drop: g(P::DiodeDrop),
            dead_time: g(P::DeadTime),
            trip_current: g(P::TripCurrent),
            open: pairs(P::OpenAHigh),
            shorted: pairs(P::ShortedAHigh),
        }
    }

    /// Gate signals after dead time: which switch of each leg conducts at the end of a step of `dt`, and the share of
    /// the step before it closes.
    #[inline(always)]
    fn gates(&self, s: &mut BridgeState<S>, old: [S; 3], new: [S; 3], dt: S) -> ([[S::Mask; 2]; 3], Option<[S; 3]>) {
        let (zero, one) = (S::zero(), S::one());
        let changed: [S::Mask; 3] = three!(|j| !old[j].equals(new[j]));
        let blank = s.blanking[0].maximum(s.blanking[1]).maximum(s.blanking[2]);
        let mut off = None;
        if S::any(changed[0] | changed[1] | changed[2] | zero.lt(blank)) {
            let left: [S; 3] = three!(|j| S::select(changed[j], self.dead_time, s.blanking[j]));
            s.blanking = three!(|j| (left[j] - dt).maximum(zero));
            // Whole steps but for rounding are whole steps.
            let tiny = S::splat(1e-6);
            off = Some(three!(|j| {
                let share = left[j] / dt;
                let share = S::select((one - tiny).lt(share), one, share);
                S::select(share.lt(tiny), zero, share)
            }));
        }
        let running = s.tripped.le(S::splat(0.5));
        let gates = three!(|j| {
            let live = match off {
                Some(off) => off[j].lt(one) & running,
                None => running,
            };
            [live & zero.lt(new[j]), live & new[j].lt(zero)]
        });
        (gates, off)
    }

    /// Mean of diode and switch over a step in which a leg is off for the share `off` of its begin.
    #[inline(always)]
    fn blank(&self, legs: &mut Legs<S>, off: [S; 3], half_supply: S, current: [S; 3]) {
        let (zero, one, half) = (S::zero(), S::one(), S::splat(0.5));
        let diode = half_supply + self.diode_drop;
        for j in 0..3 {
            let shorted = half.le(self.shorted[j][0]) | half.le(self.shorted[j][1]);
            let within = zero.lt(off[j]) & off[j].lt(one) & !current[j].equals(zero) & !shorted;
            let positive = zero.lt(current[j]);
            let voltage = off[j].fma(S::select(positive, -diode, diode) - legs.voltage[j], legs.voltage[j]);
            let rail = off[j].fma(S::select(positive, -half_supply, half_supply) - legs.rail[j], legs.rail[j]);
            legs.voltage[j] = S::select(within, voltage, legs.voltage[j]);
            legs.rail[j] = S::select(within, rail, legs.rail[j]);
        }
    }

    /// Legs over a step of `dt` from the commands (+1 high, -1 low, 0 off) and the windings; `None` when every leg is held
    /// by a switch, as it is most of the time, then with the terminal voltages and rails alone.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    pub fn connect(
        &self,
        s: &mut BridgeState<S>,
        structure: &BridgeStructure,
        old: [S; 3],
        new: [S; 3],
        half_supply: S,
        w: &impl Circuit<S>,
        dt: S,
    ) -> Connection<S> {
        let current = w.currents();
        let (mut gates, off) = self.gates(s, old, new, dt);
        if structure.switch_faults {
            gates = self.broken(gates);
        }
        if structure.trips {
            for j in 0..3 {
                self.watch(s, gates[j][0] & gates[j][1], current[j]);
            }
        }
        let mut legs = self.determined(gates, half_supply, current);
        if let Some(off) = off {
            self.blank(&mut legs, off, half_supply, current);
        }
        let all_driven = !S::any(legs.passive[0] | legs.passive[1] | legs.passive[2]);
        if all_driven && !structure.open_phases {
            return Connection { legs, loose: None };
        }
        let neutral = self.release(&mut legs, half_supply, w);
        Connection { legs, loose: Some(neutral) }
    }

    /// What the switches do, some of which stay open or closed.
    #[inline(always)]
    fn broken(&self, gates: [[S::Mask; 2]; 3]) -> [[S::Mask; 2]; 3] {
        let half = S::splat(0.5);
        three!(|j| [
            (gates[j][0] & self.open[j][0].lt(half)) | half.le(self.shorted[j][0]),
            (gates[j][1] & self.open[j][1].lt(half)) | half.le(self.shorted[j][1]),
        ])
    }

    /// Every leg at the rail of its switch that conducts.
    #[inline(always)]
    fn determined(&self, gates: [[S::Mask; 2]; 3], half_supply: S, current: [S; 3]) -> Legs<S> {
        let rail = three!(|j| S::select(gates[j][0], half_supply, -half_supply));
        Legs {
            voltage: three!(|j| (-self.on_resistance).fma(current[j], rail[j])),
            rail,
            connected: [S::mask(true); 3],
            passive: three!(|j| !(gates[j][0] | gates[j][1])),
        }
    }

    /// Legs that no switch holds, or whose phase is interrupted: diodes by the current's sign, floating at zero.
    #[inline(always)]
    fn release(&self, legs: &mut Legs<S>, half_supply: S, w: &impl Circuit<S>) -> S {
        let zero = S::zero();
        let (current, open) = (w.currents(), w.open());
        let diode = half_supply + self.diode_drop;
        for j in 0..3 {
            let positive = zero.lt(current[j]);
            let carrying = !current[j].equals(zero);
            let off = legs.passive[j];
            legs.voltage[j] = S::select(off, S::select(positive, -diode, diode), legs.voltage[j]);
            legs.rail[j] = S::select(off, S::select(positive, -half_supply, half_supply), legs.rail[j]);
            let interrupted = S::splat(0.5).le(open[j]);
            legs.connected[j] = carrying | !(off | interrupted);
            legs.passive[j] = off | interrupted;
        }
        self.turn_on(legs, half_supply, w)
    }

    #[inline(always)]
    fn watch(&self, s: &mut BridgeState<S>, shoot_through: S::Mask, current: S) {
        let zero = S::zero();
        let over = self.trip_current.lt(current.abs()) & zero.lt(self.trip_current);
        s.tripped = S::select(shoot_through | over, S::one(), s.tripped);
    }

    /// Floating phases turn on when their terminal leaves the rails; the neutral follows.
    #[inline(always)]
    fn turn_on(&self, legs: &mut Legs<S>, half_supply: S, w: &impl Circuit<S>) -> S {
        let diode = half_supply + self.diode_drop;
        let half = S::splat(0.5);
        let open = w.open();
        let (terminal, neutral) = w.potentials(legs.voltage, legs.connected);
        let mut any = S::mask(false);
        for j in 0..3 {
            let floating = !legs.connected[j] & open[j].lt(half);
            let up = floating & diode.lt(terminal[j]);
            let down = floating & terminal[j].lt(-diode);
            legs.voltage[j] = S::select(up, diode, S::select(down, -diode, legs.voltage[j]));
            legs.rail[j] = S::select(up, half_supply, S::select(down, -half_supply, legs.rail[j]));
            legs.connected[j] = legs.connected[j] | up | down;
            any = any | up | down;
        }
        if S::any(any) {
            w.potentials(legs.voltage, legs.connected).1
        } else {
            neutral
        }
    }
}

impl<S: Scalar> BridgeState<S> {
    pub fn initial() -> Self {
        Self { blanking: [S::zero(); 3], tripped: S::zero() }
    }

    /// After the second part of a step: lanes without one keep the state after the first.
    #[inline(always)]
    pub fn keep(&mut self, second: S::Mask, first: &Self) {
        self.blanking = three!(|j| S::select(second, self.blanking[j], first.blanking[j]));
        self.tripped = S::select(second, self.tripped, first.tripped);
    }
}

/// A passive leg's current stops at zero; what is left over is taken from the phases that still carry, so that the
/// star's currents keep summing to zero.
#[inline(always)]
pub fn extinguish<S: Scalar>(legs: &Legs<S>, old: [S; 3], new: [S; 3]) -> [S; 3] {
    let zero = S::zero();
    let mut current = new;
    let mut carrying = [zero; 3];
    for j in 0..3 {
        let crossed = legs.passive[j] & !zero.lt(old[j] * new[j]) & !old[j].equals(zero);
        let stopped = crossed | !legs.connected[j];
        current[j] = S::select(stopped, zero, new[j]);
        carrying[j] = S::select(stopped, zero, S::one());
    }
    let count = carrying[0] + carrying[1] + carrying[2];
    let residue = current[0] + current[1] + current[2];
    // With all three carrying nothing was cut and the rounding of the sum is left alone.
    let whole = count.equals(zero) | count.equals(S::splat(3.0));
    let share = S::select(whole, zero, residue / count.maximum(S::one()));
    three!(|j| current[j] - carrying[j] * share)
}

#[cfg(test)]
mod tests;
