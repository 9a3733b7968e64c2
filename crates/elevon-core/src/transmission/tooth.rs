//! Worn and chipped teeth of the gear: backlash that depends on the angle, and the transmission error it leaves
//! (docs/explanation/theory/friction.md, "Gear teeth").
//!
//! Wear takes most where the flanks slide, away from the pitch point: over a mesh cycle the backlash grows by s sin^2(N theta/2),
//! N meshes a turn. A chipped tooth opens it once a turn of its wheel, by b cos^2 over the mesh of that one tooth. The driven
//! side lags by half the backlash at the flank that carries, so a torque through the gear pushes the shaft along the slope of
//! that lag: the torque ripple of the transmission error.

use crate::scalar::Scalar;
use crate::variable::View;
use crate::variables;
use std::f64::consts::{PI, TAU};

variables! {
    /// Teeth of the gear.
    ToothParameter, TOOTH {
        Teeth => "teeth", "N", "1", Count(5.0, 1000.0), Plant, Some(20.0), "teeth of the wheel whose teeth are worn or chipped; ASSUMED: a pinion on the motor's shaft",
            when(&[Either(&[Away("gear.tooth_wear", 0.0), Away("gear.tooth_chip", 0.0)])]);
        TeethRatio => "teeth_ratio", "-", "1", AtLeast(1.0), Plant, Some(1.0), "turns of the motor per turn of that wheel; 1: it stands on the motor's shaft",
            when(&[Either(&[Away("gear.tooth_wear", 0.0), Away("gear.tooth_chip", 0.0)])]);
        ToothWear => "tooth_wear", "s", "rad", NonNegative, Plant, Some(0.0), "healthy 0; total backlash added where worn flanks slide most, measured at the output";
        ToothChip => "tooth_chip", "b", "rad", NonNegative, Plant, Some(0.0), "healthy 0; total backlash added while the chipped tooth carries, measured at the output";
        ToothChipAngle => "tooth_chip_angle", "-", "rad", Any, Plant, Some(0.0), "angle of the wheel at which the chipped tooth carries",
            when(&[Away("gear.tooth_chip", 0.0)]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Teeth<S> {
    teeth: S,
    per_ratio: S,
    wear: S,
    chip: S,
    chip_angle: S,
}

/// Half the added backlash, and its slope over the motor's angle.
#[derive(Clone, Copy, Debug)]
pub struct Lag<S> {
    pub half: S,
    pub slope: S,
}

impl<S: Scalar> Teeth<S> {
    /// Is there any?
    pub fn needed(view: &View<ToothParameter>) -> bool {
        view.any_away([ToothParameter::ToothWear, ToothParameter::ToothChip])
    }

    pub fn derive(raw: &[S]) -> Self {
        use ToothParameter as P;
        let g = |p: P| raw[p as usize];
        let half = S::splat(0.5);
        Self {
            teeth: g(P::Teeth),
            per_ratio: S::one() / g(P::TeethRatio),
            wear: half * g(P::ToothWear),
            chip: half * g(P::ToothChip),
            chip_angle: g(P::ToothChipAngle),
        }
    }

    /// At a motor angle.
    #[inline(always)]
    pub fn lag(&self, angle: S) -> Lag<S> {
        let half = S::splat(0.5);
        let wheel = angle * self.per_ratio;
        let (sin, cos) = (self.teeth * wheel).sin_cos();
        // sin^2(x/2) = (1 - cos x)/2.
        let worn = self.wear * half * (S::one() - cos);
        let worn_slope = self.wear * half * self.teeth * sin;
        let turns = (wheel - self.chip_angle) * S::splat(1.0 / TAU);
        let from = S::splat(TAU) * (turns - turns.round());
        // cos^2(x/2) = (1 + cos x)/2 over the one mesh on either side of which the neighbours carry.
        let (sin, cos) = (self.teeth * from).sin_cos();
        let inside = (self.teeth * from).abs().lt(S::splat(PI));
        let chipped = S::select(inside, self.chip * half * (S::one() + cos), S::zero());
        let chipped_slope = S::select(inside, -(self.chip * half * self.teeth * sin), S::zero());
        Lag { half: worn + chipped, slope: (worn_slope + chipped_slope) * self.per_ratio }
    }
}

impl<S: Scalar> Lag<S> {
    /// Torque on the motor's shaft by the torque `through` the gear at the output, positive where it drives forwards: the
    /// flank that carries is the one the load presses on, and it yields as the lag grows.
    #[inline(always)]
    pub fn torque(&self, through: S) -> S {
        through.abs() * self.slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ToothParameter as P;

    fn teeth(changes: &[(P, f64)]) -> Teeth<f64> {
        let mut raw: Vec<f64> = TOOTH.iter().map(|v| v.default.unwrap_or(0.0)).collect();
        for &(p, x) in changes {
            raw[p as usize] = x;
        }
        Teeth::derive(&raw)
    }

    #[test]
    fn healthy_teeth_add_nothing() {
        for angle in [0.0, 0.4, -3.0] {
            let lag = teeth(&[]).lag(angle);
            assert_eq!((lag.half, lag.slope), (0.0, 0.0));
        }
    }

    #[test]
    fn wear_opens_the_backlash_away_from_the_pitch_point() {
        let t = teeth(&[(P::ToothWear, 2e-4), (P::TeethRatio, 3.0)]);
        assert!(t.lag(0.0).half.abs() < 1e-18);
        assert!((t.lag(3.0 * PI / 20.0).half - 1e-4).abs() < 1e-15);
        assert!((t.lag(3.0 * TAU / 20.0).half).abs() < 1e-15);
    }

    #[test]
    fn a_chipped_tooth_opens_it_once_a_turn() {
        let t = teeth(&[(P::ToothChip, 2e-3), (P::ToothChipAngle, 1.0)]);
        assert!((t.lag(1.0).half - 1e-3).abs() < 1e-15 && (t.lag(1.0 + 5.0 * TAU).half - 1e-3).abs() < 1e-12);
        let n = 100_000;
        let open = (0..n).filter(|&i| t.lag(TAU * f64::from(i) / f64::from(n)).half > 0.0).count() as f64 / f64::from(n);
        assert!((open - 1.0 / 20.0).abs() < 1e-4, "{open}");
    }

    #[test]
    fn the_slope_is_the_derivative_of_the_lag() {
        let t = teeth(&[(P::ToothWear, 3e-4), (P::ToothChip, 2e-3), (P::ToothChipAngle, 0.5), (P::TeethRatio, 2.0)]);
        let h = 1e-6;
        for i in 0..400 {
            let angle = 0.011 * f64::from(i);
            let slope = (t.lag(angle + h).half - t.lag(angle - h).half) / (2.0 * h);
            assert!((slope - t.lag(angle).slope).abs() < 1e-7, "at {angle}");
        }
    }

    /// Whichever direction the load pushes, the flank yields: no work over a mesh.
    #[test]
    fn the_ripple_does_no_work_over_a_mesh() {
        let t = teeth(&[(P::ToothWear, 3e-4)]);
        for through in [25.0, -25.0] {
            let (n, mesh) = (2000, TAU / 20.0);
            let work: f64 = (0..n).map(|i| t.lag(mesh * f64::from(i) / f64::from(n)).torque(through) * mesh / f64::from(n)).sum();
            assert!(work.abs() < 1e-12, "{work}");
        }
    }
}
