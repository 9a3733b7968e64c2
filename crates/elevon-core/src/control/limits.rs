//! What keeps a drive within its limits: field weakening at the voltage limit, derating of the current by the winding's
//! temperature.
//!
//! Field weakening integrates what the voltage that the current controller wants exceeds its share of the limit by, over the
//! slope of that voltage, p omega L, so that the loop closes at its bandwidth at any speed:
//!
//!     di_d/dt = w (m V_dc / sqrt 3 - |v|) / (p |omega| L),   -I_fw <= i_d <= 0
//!
//! i_d also stays above -k/(p L), where it has taken all of the magnets' voltage and more of it would bring voltage back.
//! At rest with this loop |v| = m V_dc / sqrt 3. The torque current keeps what the direct one leaves of the current limit.

use crate::scalar::Scalar;
use crate::variable::{Switch, View};
use crate::variables;

variables! {
    /// Field weakening and derating.
    LimitParameter, LIMITS {
        DirectCurrent => "direct_current", "i_d_ref", "A", Any, Controller, Some(0.0), "direct current reference, peak; below 0 it weakens the field, and with a saliency below 1 it adds torque",
            when(&[Chosen("drive.kind", &["pwm"])]);
        FieldWeakening => "field_weakening", "-", "1", Choice(Switch::NAMES), Controller, Some(0.0), "at the voltage limit a direct current weakens the field (carrier drive)",
            when(&[Chosen("drive.kind", &["pwm"])]);
        FieldWeakeningCurrent => "field_weakening_current", "I_fw", "A", Positive, Controller, Some(5.0), "most direct current of the field weakening, peak, below control.current_limit; never more than pwm.emf_constant over motor.pole_pairs times pwm.inductance, which takes all of the magnets' voltage. ASSUMED: about the rated current of a 1 kW servo motor",
            when(&[Chosen("drive.kind", &["pwm"]), Chosen("control.field_weakening", &["on"])]);
        FieldWeakeningVoltage => "field_weakening_voltage", "m", "1", Between(0.1, 1.0), Controller, Some(0.95), "share of the largest voltage, V_dc / sqrt 3, that the field weakening holds. ASSUMED: what is left keeps the currents controlled",
            when(&[Chosen("drive.kind", &["pwm"]), Chosen("control.field_weakening", &["on"])]);
        FieldWeakeningBandwidth => "field_weakening_bandwidth", "w", "1/s", Positive, Controller, Some(60.0), "bandwidth of the field weakening's loop. ASSUMED: 10 Hz, far below that of the current loop",
            when(&[Chosen("drive.kind", &["pwm"]), Chosen("control.field_weakening", &["on"])]);
        Derating => "derating", "-", "1", Choice(Switch::NAMES), Controller, Some(0.0), "the current limit falls with the winding's temperature (thermal network)",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        DeratingStart => "derating_start", "T_1", "K", Positive, Controller, Some(403.15), "winding temperature from which on the current limit falls. ASSUMED: 130 C, the default of thermal.warning",
            when(&[Chosen("control.derating", &["on"]), Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        DeratingEnd => "derating_end", "T_2", "K", Positive, Controller, Some(428.15), "winding temperature at which no current is left. ASSUMED: 155 C, the limit of class F",
            when(&[Chosen("control.derating", &["on"]), Chosen("thermal.model", &["quasi_static", "dynamic"])]);
    }
}

/// What of it a run needs; equal over a lane block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LimitStructure {
    pub weakens: bool,
    pub derates: bool,
    /// A direct current flows by order.
    pub direct: bool,
}

impl LimitStructure {
    /// `carrier`: the drive controls its direct current; `heated`: the winding has a temperature.
    pub fn read(view: &View<LimitParameter>, carrier: bool, heated: bool) -> Self {
        use LimitParameter as P;
        let on = |p: P| Switch::read(view.value(p)) == Switch::On;
        let weakens = carrier && on(P::FieldWeakening);
        Self { weakens, derates: heated && on(P::Derating), direct: weakens || carrier && view.away(P::DirectCurrent) }
    }

    /// Is the torque's limit another than the controller's?
    pub fn moves(&self) -> bool {
        self.derates || self.direct
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Limits<S> {
    direct: S,
    most: S,
    margin: S,
    /// Share of the loop's error that a tick closes.
    closing: S,
    /// Electrical speed times inductance per mechanical speed, as the drive believes it.
    slope: S,
    start: S,
    per_width: S,
    per_current_limit: S,
}

impl<S: Scalar> Limits<S> {
    /// On a tick of `dt`; `slope` is p L and `emf` k, as the drive believes them, `current_limit` the controller's.
    pub fn derive(raw: &[S], [slope, emf]: [S; 2], current_limit: S, dt: S) -> Self {
        use LimitParameter as P;
        let (g, one) = (|p: P| raw[p as usize], S::one());
        let known = S::zero().lt(slope) & S::zero().lt(emf);
        let all = S::select(known, emf / S::select(known, slope, one), g(P::FieldWeakeningCurrent));
        Self {
            direct: g(P::DirectCurrent),
            most: g(P::FieldWeakeningCurrent).minimum(all),
            margin: g(P::FieldWeakeningVoltage) * S::splat(1.0 / 3.0_f64.sqrt()),
            closing: one - (-(g(P::FieldWeakeningBandwidth) * dt)).exp(),
            slope,
            start: g(P::DeratingStart),
            per_width: one / (g(P::DeratingEnd) - g(P::DeratingStart)),
            per_current_limit: one / current_limit,
        }
    }

    /// Direct current reference of the next tick from the present one; `size` of the voltage that is wanted.
    #[inline(always)]
    pub fn weaken(&self, weakening: S, speed: S, size: S, supply: S) -> S {
        let room = self.margin * supply - size;
        let slope = (self.slope * speed).abs();
        let moves = S::zero().lt(slope);
        let change = S::select(moves, self.closing * room / S::select(moves, slope, S::one()), S::zero());
        (weakening + change).clamp(-self.most, S::zero())
    }

    /// Direct current reference.
    #[inline(always)]
    pub fn reference(&self, weakening: S) -> S {
        self.direct + weakening
    }

    /// Share of the current limit that the winding's temperature leaves.
    #[inline(always)]
    pub fn derated(&self, winding: S) -> S {
        (S::one() - (winding - self.start) * self.per_width).clamp(S::zero(), S::one())
    }

    /// Share of the current limit that is left for the torque's current.
    #[inline(always)]
    pub fn left(&self, derated: S, direct: S) -> S {
        let used = direct * self.per_current_limit;
        (derated * derated - used * used).maximum(S::zero()).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits() -> Limits<f64> {
        let mut raw: Vec<f64> = LIMITS.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        raw[LimitParameter::FieldWeakeningCurrent as usize] = 8.0;
        Limits::derive(&raw, [4.0 * 0.03, 0.9], 10.0, 125e-6)
    }

    #[test]
    fn every_default_is_in_its_range() {
        for v in LIMITS {
            assert!(v.default.is_some_and(|x| v.range.contains(x)), "{}", v.path);
        }
    }

    /// The voltage of a motor without resistance: it comes to rest at its share of the limit.
    #[test]
    fn the_loop_rests_at_its_share_of_the_voltage() {
        let (l, speed, supply) = (limits(), 300.0, 380.0);
        let size = |i_d: f64| 0.9 * speed + 4.0 * speed * 0.03 * i_d;
        let mut i_d = 0.0;
        for _ in 0..4000 {
            i_d = l.weaken(i_d, speed, size(i_d), supply);
        }
        assert!((size(i_d) - 0.95 * supply / 3.0_f64.sqrt()).abs() < 1e-6, "{i_d}");
        assert_eq!(l.weaken(0.0, speed, 0.0, supply), 0.0);
        // 7.5 A take all of the magnets' voltage.
        assert_eq!(l.weaken(-8.0, speed, 1e4, supply), -0.9 / 0.12);
        assert_eq!(l.weaken(-3.0, 0.0, 1e4, supply), -3.0);
    }

    #[test]
    fn the_current_limit_is_a_circle_that_falls_with_the_temperature() {
        let l = limits();
        assert_eq!([l.derated(300.0), l.derated(440.0)], [1.0, 0.0]);
        assert!((l.derated(415.65) - 0.5).abs() < 1e-12);
        assert!((l.left(1.0, -6.0) - 0.8).abs() < 1e-12);
        assert_eq!(l.left(0.5, -6.0), 0.0);
    }
}
