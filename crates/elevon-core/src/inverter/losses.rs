//! Switching losses of the bridge, and the heat of the drive that they and the conduction losses make.
//!
//! A leg that changes over from rail to rail with a current i crosses V and i together: V |i| t / 2 is lost, t the sum
//! of voltage and current transition (linear both; the law is ASSUMED, the papers' switches are ideal). One in two transitions of a
//! period is soft: t is the mean over both.

use crate::kept;
use crate::scalar::Scalar;
use crate::three;
use crate::variable::acts::When;
use crate::variable::View;
use crate::variables;

variables! {
    /// Switching losses.
    SwitchingParameter, SWITCHING {
        SwitchingTime => "switching_time", "t_sw", "s", NonNegative, Plant, Some(0.0), "each transition of a leg loses V |i| t_sw / 2; 0: ideal switches",
            high_only("it has no inverter losses").when(&[Chosen("drive.kind", &["hysteresis", "pwm"])]);
    }
}

variables! {
    /// The drive as a thermal node of its own: its losses heat it, not the winding.
    DriveHeatParameter, DRIVE_HEAT {
        DriveCapacity => "drive_capacity", "C_d", "J/K", Positive, Plant, Some(500.0), "heat capacity of the drive with its heat sink (ASSUMED: half a kilogram of aluminium)",
            high_only("it has no inverter losses").when(&[Chosen("thermal.model", &["quasi_static", "dynamic"]), LOSSES]);
        DriveToAir => "drive_to_air", "R_d", "K/W", Positive, Plant, Some(0.5), "thermal resistance from the drive to the air (ASSUMED: a heat sink of a hand's size, natural convection)",
            high_only("it has no inverter losses").when(&[Chosen("thermal.model", &["quasi_static", "dynamic"]), LOSSES]);
    }
}

/// What makes the inverter lose anything.
const LOSSES: When = When::Either(&[
    When::Away("inverter.switching_time", 0.0),
    When::Away("inverter.on_resistance", 0.0),
    When::Away("inverter.diode_drop", 0.0),
]);

/// Energy lost by legs that go from `old` to `new` commands; a leg that is or becomes off counts half.
#[inline(always)]
pub fn switching_loss<S: Scalar>(time: S, supply: S, current: [S; 3], old: [S; 3], new: [S; 3]) -> S {
    let quarter = S::splat(0.25) * time * supply;
    let lost: [S; 3] = three!(|j| (new[j] - old[j]).abs() * current[j].abs());
    quarter * (lost[0] + lost[1] + lost[2])
}

/// Are there switching losses?
pub fn switches(view: &View<SwitchingParameter>) -> bool {
    view.away(SwitchingParameter::SwitchingTime)
}

#[derive(Clone, Copy, Debug)]
pub struct DriveHeat<S> {
    capacity: S,
    to_air: S,
    ambient: S,
    period: S,
    decay: S,
}

#[derive(Clone, Copy, Debug)]
pub struct DriveHeatState<S> {
    pub temperature: S,
    begin: S,
    /// Losses accounted at the last tick, J.
    accounted: S,
    /// Mean loss of the last tick, W.
    pub power: S,
    /// Given to the air since the start, J.
    pub heat_out: S,
}

kept!(DriveHeatState<f64> as DriveHeatState { temperature, begin, accounted, power, heat_out });

impl<S: Scalar> DriveHeat<S> {
    pub fn derive(raw: &[S], ambient: S, period: S) -> Self {
        let g = |p: DriveHeatParameter| raw[p as usize];
        let (capacity, to_air) = (g(DriveHeatParameter::DriveCapacity), g(DriveHeatParameter::DriveToAir));
        Self { capacity, to_air, ambient, period, decay: (-(period / (capacity * to_air))).exp() }
    }

    /// The drive begins as warm as the air.
    pub fn start(&self) -> DriveHeatState<S> {
        let zero = S::zero();
        DriveHeatState { temperature: self.ambient, begin: self.ambient, accounted: zero, power: zero, heat_out: zero }
    }

    /// One tick; `losses` are those since the start. Exact for a loss that is even over the tick.
    pub fn tick(&self, s: &mut DriveHeatState<S>, losses: S) {
        let heat = losses - s.accounted;
        s.accounted = losses;
        s.power = heat / self.period;
        let settled = self.to_air.fma(s.power, self.ambient);
        let after = self.decay.fma(s.temperature - settled, settled);
        s.heat_out = s.heat_out + (heat - self.capacity * (after - s.temperature));
        s.temperature = after;
    }

    /// Heat in the drive above that of the start, J.
    pub fn stored(&self, s: &DriveHeatState<S>) -> S {
        self.capacity * (s.temperature - s.begin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transition_loses_half_the_product_of_voltage_current_and_time() {
        let lost = |new: [f64; 3]| switching_loss(2e-7, 380.0, [4.0, -3.0, -1.0], [1.0, 1.0, -1.0], new);
        assert_eq!(lost([1.0, 1.0, -1.0]), 0.0);
        assert!((lost([1.0, -1.0, -1.0]) - 0.5 * 380.0 * 3.0 * 2e-7).abs() < 1e-15);
        assert!((lost([0.0, 1.0, -1.0]) - 0.25 * 380.0 * 4.0 * 2e-7).abs() < 1e-15);
    }

    #[test]
    fn the_drive_warms_exponentially_and_its_heat_closes() {
        let (capacity, to_air, period, power) = (400.0, 0.5, 0.01, 60.0);
        let heat = DriveHeat::derive(&[capacity, to_air], 293.15, period);
        let mut s = heat.start();
        for k in 1..=10_000 {
            heat.tick(&mut s, power * period * f64::from(k));
        }
        let exact = 293.15 + to_air * power * (1.0 - libm::exp(-100.0 / (capacity * to_air)));
        assert!((s.temperature - exact).abs() < 1e-9);
        assert!((heat.stored(&s) + s.heat_out - power * 100.0).abs() < 1e-8);
    }
}
