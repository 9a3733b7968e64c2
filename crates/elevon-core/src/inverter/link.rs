//! The DC link of a servo's drive: a capacitor that a source feeds through its resistance and a connector.
//!
//! Over a step the bridge takes an energy E from the capacitor. With the connector open, C v^2 / 2 falls by just that:
//! v'^2 = v^2 - 2 E / C, the discharge at constant power, upwards when the motor brakes. With the source on, E is a current i
//! over the step and v goes exponentially to V_s - R_s i. A brake chopper, where there is one, takes
//! C v^2 / 2 (1 - exp(-2 dt / (R C))) of a step while it is on; the drive trips beyond the limits of the link's voltage.

use crate::scalar::Scalar;
use crate::variable::View;
use crate::{choices, kept, variables};

choices! {
    SourceRegeneration { Accept "accept", Block "block" }
}

variables! {
    /// Capacitor, source and connector of the DC link.
    LinkParameter, LINK {
        LinkCapacitance => "link_capacitance", "C", "F", NonNegative, Plant, Some(0.0), "capacitor of the DC link, fed through inverter.source_resistance; 0: a stiff link, the source itself";
        SourceResistance => "source_resistance", "R_s", "ohm", Positive, Plant, Some(0.5), "source, harness and connector in front of the link's capacitor",
            when(&[Away("inverter.link_capacitance", 0.0)]);
        SourceRegeneration => "source_regeneration", "-", "1", Choice(SourceRegeneration::NAMES), Plant, Some(0.0), "does the source take current back, or (a rectifier) does a braking motor charge the link",
            when(&[Away("inverter.link_capacitance", 0.0)]);
        ConnectorOpen => "connector_open", "-", "1", Flag, Plant, Some(0.0), "1: the power connector is open, the link's capacitor alone feeds the bridge",
            when(&[Away("inverter.link_capacitance", 0.0)]);
        OverVoltageTrip => "over_voltage_trip", "V_max", "V", NonNegative, Controller, Some(0.0), "the drive trips when the link's voltage exceeds it; 0: no over-voltage trip",
            when(&[Away("inverter.link_capacitance", 0.0)]);
        UnderVoltageTrip => "under_voltage_trip", "V_min", "V", NonNegative, Controller, Some(0.0), "the drive trips when the link's voltage falls below it; 0: no under-voltage trip",
            when(&[Away("inverter.link_capacitance", 0.0)]);
        ChopperResistance => "chopper_resistance", "R_ch", "ohm", NonNegative, Plant, Some(0.0), "brake resistor that a chopper puts across the link; 0: there is no brake chopper",
            when(&[Away("inverter.link_capacitance", 0.0)]);
        ChopperVoltage => "chopper_voltage", "V_ch", "V", Positive, Controller, Some(450.0), "link voltage above which the chopper is on; ASSUMED: 1.2 times a link of 380 V",
            when(&[Away("inverter.link_capacitance", 0.0), Away("inverter.chopper_resistance", 0.0)]);
        ChopperBand => "chopper_band", "-", "V", NonNegative, Controller, Some(20.0), "the chopper is off again this much below chopper_voltage; ASSUMED: some 5 % of it",
            when(&[Away("inverter.link_capacitance", 0.0), Away("inverter.chopper_resistance", 0.0)]);
    }
}

/// A bridge that has emptied the link still finds this, V: from there a braking motor charges it again.
const EMPTY: f64 = 1e-3;

#[derive(Clone, Copy, Debug)]
pub struct DcLink<S> {
    capacitance: S,
    resistance: S,
    dt: S,
    /// exp(-dt / (R C)).
    decay: S,
    /// 1: no current back.
    blocks: S,
    /// 1: the connector is open.
    open: S,
    /// Least and largest voltage that trip the drive; 0: none does.
    limits: [S; 2],
    /// Link voltages at which the chopper goes off and on, and the share of the link's energy that it takes in a step.
    chopper: [S; 2],
    chopper_share: S,
}

#[derive(Clone, Copy, Debug)]
pub struct DcLinkState<S> {
    /// NaN before the first step: the capacitor begins at the source's voltage.
    voltage: S,
    begin: S,
    /// J, since the start: given by the source, lost in its resistance and in the chopper's.
    pub given: S,
    pub lost: S,
    /// 1: the chopper is on.
    chopping: S,
    /// Voltage that tripped the drive; 0: none has.
    trip: S,
}

kept!(DcLinkState<f64> as DcLinkState { voltage, begin, given, lost, chopping, trip });

impl<S: Scalar> DcLink<S> {
    pub fn needed(view: &View<LinkParameter>) -> bool {
        view.away(LinkParameter::LinkCapacitance)
    }

    pub fn derive(raw: &[S], dt: S) -> Self {
        let g = |p: LinkParameter| raw[p as usize];
        let (zero, one) = (S::zero(), S::one());
        let (capacitance, resistance) = (g(LinkParameter::LinkCapacitance), g(LinkParameter::SourceResistance));
        let guarded = S::select(zero.lt(capacitance), capacitance, one);
        Self {
            capacitance: guarded,
            resistance,
            dt,
            decay: (-(dt / (resistance * guarded))).exp(),
            blocks: g(LinkParameter::SourceRegeneration),
            open: g(LinkParameter::ConnectorOpen),
            limits: [g(LinkParameter::UnderVoltageTrip), g(LinkParameter::OverVoltageTrip)],
            chopper: [g(LinkParameter::ChopperVoltage) - g(LinkParameter::ChopperBand), g(LinkParameter::ChopperVoltage)],
            chopper_share: chopper_share(g(LinkParameter::ChopperResistance), guarded, dt),
        }
    }

    /// May the link's voltage trip the drive?
    pub fn trips(view: &View<LinkParameter>) -> bool {
        Self::needed(view) && view.any_away([LinkParameter::OverVoltageTrip, LinkParameter::UnderVoltageTrip])
    }

    /// 1 once the link's voltage has tripped the drive.
    #[inline(always)]
    pub fn tripped(&self, s: &DcLinkState<S>) -> S {
        S::indicator(S::zero().lt(s.trip))
    }

    /// Why it has.
    pub fn trip_reason(&self, s: &DcLinkState<S>, lane: usize) -> Option<String> {
        let (voltage, [least, most]) = (s.trip.lane(lane), self.limits.map(|limit| limit.lane(lane)));
        let (side, path, limit) = if most > 0.0 && voltage > most {
            ("above", "inverter.over_voltage_trip", most)
        } else {
            ("below", "inverter.under_voltage_trip", least)
        };
        (voltage > 0.0).then(|| format!("the drive tripped: the link has {voltage:.1} V, {side} {path} = {limit} V"))
    }

    /// Voltage of the link.
    #[inline(always)]
    pub fn voltage(&self, s: &DcLinkState<S>, source: S) -> S {
        S::select(s.voltage.equals(s.voltage), s.voltage, source)
    }

    /// A step in which the bridge took the energy `drawn`.
    #[inline(always)]
    pub fn step(&self, s: &mut DcLinkState<S>, source: S, drawn: S) {
        let (half, two) = (S::splat(0.5), S::splat(2.0));
        let before = self.voltage(s, source);
        s.begin = S::select(s.begin.equals(s.begin), s.begin, before);
        s.chopping = S::select(self.chopper[1].lt(before), S::one(), S::select(before.lt(self.chopper[0]), S::zero(), s.chopping));
        let chopped = s.chopping * self.chopper_share * (half * self.capacitance * before * before);
        let drawn = drawn + chopped;
        s.lost = s.lost + chopped;
        let alone = (before * before - two * drawn / self.capacitance).maximum(S::zero()).sqrt().maximum(S::splat(EMPTY));
        let bus = drawn / (self.dt * half * (before + alone));
        let settled = source - self.resistance * bus;
        let fed = self.decay.fma(before - settled, settled);
        let refused = half.lt(self.blocks) & source.le(before.minimum(alone));
        let off = half.le(self.open) | refused;
        s.voltage = S::select(off, alone, fed.maximum(S::splat(EMPTY)));
        let [least, most] = self.limits;
        let beyond = (S::zero().lt(most) & most.lt(s.voltage)) | s.voltage.lt(least);
        s.trip = S::select(beyond & s.trip.equals(S::zero()), s.voltage, s.trip);
        // i(t) = bus + first exp(-t / (R C)), integrated.
        let first = (settled - before) / self.resistance;
        let time = self.resistance * self.capacitance;
        let faded = S::one() - self.decay;
        let charge = bus * self.dt + first * time * faded;
        let squares =
            bus * bus * self.dt + two * bus * first * time * faded + half * first * first * time * faded * (S::one() + self.decay);
        s.given = s.given + S::select(off, S::zero(), source * charge);
        s.lost = s.lost + S::select(off, S::zero(), self.resistance * squares);
    }

    /// Energy of the capacitor above that of the start, J.
    #[inline(always)]
    pub fn stored(&self, s: &DcLinkState<S>) -> S {
        let change = S::splat(0.5) * self.capacitance * (s.voltage * s.voltage - s.begin * s.begin);
        S::select(change.equals(change), change, S::zero())
    }
}

/// Share of the link's energy that a resistor takes in a step; none where there is no resistor.
fn chopper_share<S: Scalar>(resistance: S, capacitance: S, dt: S) -> S {
    let there = S::zero().lt(resistance);
    let taken = S::one() - (S::splat(-2.0) * dt / (S::select(there, resistance, S::one()) * capacitance)).exp();
    S::select(there, taken, S::zero())
}

impl<S: Scalar> DcLinkState<S> {
    pub fn initial() -> Self {
        let nan = S::splat(f64::NAN);
        Self { voltage: nan, begin: nan, given: S::zero(), lost: S::zero(), chopping: S::zero(), trip: S::zero() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAPACITANCE: f64 = 1e-3;
    const RESISTANCE: f64 = 0.5;
    const SOURCE: f64 = 380.0;

    fn link(dt: f64, open: f64, blocks: f64) -> DcLink<f64> {
        DcLink::derive(&[CAPACITANCE, RESISTANCE, blocks, open, 0.0, 0.0, 0.0, 450.0, 20.0], dt)
    }

    /// Voltage after `steps` steps at a power, which may depend on the voltage.
    fn run(link: &DcLink<f64>, steps: usize, dt: f64, power: impl Fn(f64) -> f64) -> (f64, DcLinkState<f64>, f64) {
        let mut state = DcLinkState::initial();
        let mut drawn = 0.0;
        for _ in 0..steps {
            let energy = power(link.voltage(&state, SOURCE)) * dt;
            drawn += energy;
            link.step(&mut state, SOURCE, energy);
        }
        (link.voltage(&state, SOURCE), state, drawn)
    }

    #[test]
    fn alone_it_discharges_at_constant_power_as_the_root_of_time() {
        for (dt, steps) in [(1e-6, 40_000), (5e-4, 80)] {
            let (v, state, _) = run(&link(dt, 1.0, 0.0), steps, dt, |_| 1500.0);
            let exact = (SOURCE * SOURCE - 2.0 * 1500.0 * 0.04 / CAPACITANCE).sqrt();
            assert!((v / exact - 1.0).abs() < 1e-9, "{v} {exact}");
            assert_eq!((state.given, state.lost), (0.0, 0.0));
        }
    }

    #[test]
    fn alone_it_discharges_into_a_resistor_exponentially() {
        let (v, ..) = run(&link(1e-6, 1.0, 0.0), 20_000, 1e-6, |v| v * v / 20.0);
        let exact = SOURCE * (-0.02_f64 / (20.0 * CAPACITANCE)).exp();
        assert!((v / exact - 1.0).abs() < 1e-4, "{v} {exact}");
    }

    #[test]
    fn alone_it_rises_by_what_a_braking_motor_gives_and_empty_it_can_rise_again() {
        let (v, ..) = run(&link(1e-6, 1.0, 0.0), 10_000, 1e-6, |_| -2000.0);
        let exact = (SOURCE * SOURCE + 2.0 * 20.0 / CAPACITANCE).sqrt();
        assert!((v / exact - 1.0).abs() < 1e-9);
        let open = link(1e-6, 1.0, 0.0);
        let mut state = DcLinkState::initial();
        open.step(&mut state, SOURCE, 1e3);
        assert_eq!(open.voltage(&state, SOURCE), EMPTY);
        for _ in 0..1000 {
            let v = open.voltage(&state, SOURCE);
            open.step(&mut state, SOURCE, -v * 5.0 * 1e-6);
        }
        let charged = 5.0 * 1e-3 / CAPACITANCE;
        // The first steps rise as the root of what they were given.
        assert!((open.voltage(&state, SOURCE) / charged - 1.0).abs() < 1e-2);
    }

    #[test]
    fn fed_it_settles_where_source_and_load_meet_and_its_books_close() {
        for (dt, steps) in [(1e-6, 20_000), (5e-4, 400)] {
            let (v, state, drawn) = run(&link(dt, 0.0, 0.0), steps, dt, |_| 2000.0);
            // (V_s - v) / R = P / v.
            let exact = 0.5 * (SOURCE + (SOURCE * SOURCE - 4.0 * RESISTANCE * 2000.0).sqrt());
            // The current of a step is that of the unfed link: an error of first order in the step.
            assert!((v / exact - 1.0).abs() < 0.1 * dt, "{dt}: {v} {exact}");
            let stored = link(dt, 0.0, 0.0).stored(&state);
            // That current is too large by P dt / (2 C v^2), and so is what the source gives for it.
            let excess = 2000.0 * dt / (2.0 * CAPACITANCE * exact * exact);
            let open_books = (state.given - state.lost - stored - drawn) / drawn;
            assert!((open_books / excess - 1.0).abs() < 0.1, "{dt}: {open_books} {excess}");
        }
    }

    #[test]
    fn a_source_that_blocks_takes_nothing_back() {
        let blocked = run(&link(1e-6, 0.0, 1.0), 10_000, 1e-6, |_| -2000.0);
        assert!((blocked.0 / (SOURCE * SOURCE + 4e4).sqrt() - 1.0).abs() < 1e-6);
        assert_eq!(blocked.1.given, 0.0);
        let accepted = run(&link(1e-6, 0.0, 0.0), 10_000, 1e-6, |_| -2000.0);
        assert!(accepted.1.given < -15.0 && accepted.0 < SOURCE + 5.0);
    }
}
