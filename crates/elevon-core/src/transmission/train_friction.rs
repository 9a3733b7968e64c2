//! Friction of the whole train as measured: mean force over speed for the connected train (FFM) and for the screw
//! side alone (FF), and five harmonics of the screw's pitch (P 4.1.1, eqs. 34 to 36, Figs. 4.3 and 4.4).

use crate::piecewise::{Curve, Knots};
use crate::scalar::Scalar;
use crate::transmission::lubricant::Lubricant;
use crate::variables;

/// Knots of the speed tables.
pub const SPEEDS: usize = 8;
/// Harmonics of the pitch.
pub const HARMONICS: usize = 5;

variables! {
    /// Tables over ram speed, linear between the knots and held outside.
    TrainFrictionParameter, TRAIN_FRICTION {
        Speed1 => "speed_1", "v_1", "m/s", Positive, Plant, None, "knot 1 of the speed tables";
        Speed2 => "speed_2", "v_2", "m/s", Positive, Plant, None, "knot 2 of the speed tables";
        Speed3 => "speed_3", "v_3", "m/s", Positive, Plant, None, "knot 3 of the speed tables";
        Speed4 => "speed_4", "v_4", "m/s", Positive, Plant, None, "knot 4 of the speed tables";
        Speed5 => "speed_5", "v_5", "m/s", Positive, Plant, None, "knot 5 of the speed tables";
        Speed6 => "speed_6", "v_6", "m/s", Positive, Plant, None, "knot 6 of the speed tables";
        Speed7 => "speed_7", "v_7", "m/s", Positive, Plant, None, "knot 7 of the speed tables";
        Speed8 => "speed_8", "v_8", "m/s", Positive, Plant, None, "knot 8 of the speed tables";
        FfmExtension1 => "ffm_extension_1", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, extending, at knot 1";
        FfmExtension2 => "ffm_extension_2", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, extending, at knot 2";
        FfmExtension3 => "ffm_extension_3", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, extending, at knot 3";
        FfmExtension4 => "ffm_extension_4", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, extending, at knot 4";
        FfmExtension5 => "ffm_extension_5", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, extending, at knot 5";
        FfmExtension6 => "ffm_extension_6", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, extending, at knot 6";
        FfmExtension7 => "ffm_extension_7", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, extending, at knot 7";
        FfmExtension8 => "ffm_extension_8", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, extending, at knot 8";
        FfmRetraction1 => "ffm_retraction_1", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, retracting, at knot 1";
        FfmRetraction2 => "ffm_retraction_2", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, retracting, at knot 2";
        FfmRetraction3 => "ffm_retraction_3", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, retracting, at knot 3";
        FfmRetraction4 => "ffm_retraction_4", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, retracting, at knot 4";
        FfmRetraction5 => "ffm_retraction_5", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, retracting, at knot 5";
        FfmRetraction6 => "ffm_retraction_6", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, retracting, at knot 6";
        FfmRetraction7 => "ffm_retraction_7", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, retracting, at knot 7";
        FfmRetraction8 => "ffm_retraction_8", "F_ffm", "N", NonNegative, Plant, None, "mean friction of the whole train, retracting, at knot 8";
        FfExtension1 => "ff_extension_1", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, extending, at knot 1";
        FfExtension2 => "ff_extension_2", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, extending, at knot 2";
        FfExtension3 => "ff_extension_3", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, extending, at knot 3";
        FfExtension4 => "ff_extension_4", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, extending, at knot 4";
        FfExtension5 => "ff_extension_5", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, extending, at knot 5";
        FfExtension6 => "ff_extension_6", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, extending, at knot 6";
        FfExtension7 => "ff_extension_7", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, extending, at knot 7";
        FfExtension8 => "ff_extension_8", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, extending, at knot 8";
        FfRetraction1 => "ff_retraction_1", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, retracting, at knot 1";
        FfRetraction2 => "ff_retraction_2", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, retracting, at knot 2";
        FfRetraction3 => "ff_retraction_3", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, retracting, at knot 3";
        FfRetraction4 => "ff_retraction_4", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, retracting, at knot 4";
        FfRetraction5 => "ff_retraction_5", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, retracting, at knot 5";
        FfRetraction6 => "ff_retraction_6", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, retracting, at knot 6";
        FfRetraction7 => "ff_retraction_7", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, retracting, at knot 7";
        FfRetraction8 => "ff_retraction_8", "F_ff", "N", NonNegative, Plant, None, "mean friction of screw and second stage alone, retracting, at knot 8";
        Harmonic1_1 => "harmonic_1_1", "A_1", "N", NonNegative, Plant, None, "amplitude of harmonic 1 of the pitch, at knot 1";
        Harmonic1_2 => "harmonic_1_2", "A_1", "N", NonNegative, Plant, None, "amplitude of harmonic 1 of the pitch, at knot 2";
        Harmonic1_3 => "harmonic_1_3", "A_1", "N", NonNegative, Plant, None, "amplitude of harmonic 1 of the pitch, at knot 3";
        Harmonic1_4 => "harmonic_1_4", "A_1", "N", NonNegative, Plant, None, "amplitude of harmonic 1 of the pitch, at knot 4";
        Harmonic1_5 => "harmonic_1_5", "A_1", "N", NonNegative, Plant, None, "amplitude of harmonic 1 of the pitch, at knot 5";
        Harmonic1_6 => "harmonic_1_6", "A_1", "N", NonNegative, Plant, None, "amplitude of harmonic 1 of the pitch, at knot 6";
        Harmonic1_7 => "harmonic_1_7", "A_1", "N", NonNegative, Plant, None, "amplitude of harmonic 1 of the pitch, at knot 7";
        Harmonic1_8 => "harmonic_1_8", "A_1", "N", NonNegative, Plant, None, "amplitude of harmonic 1 of the pitch, at knot 8";
        Harmonic2_1 => "harmonic_2_1", "A_2", "N", NonNegative, Plant, None, "amplitude of harmonic 2 of the pitch, at knot 1";
        Harmonic2_2 => "harmonic_2_2", "A_2", "N", NonNegative, Plant, None, "amplitude of harmonic 2 of the pitch, at knot 2";
        Harmonic2_3 => "harmonic_2_3", "A_2", "N", NonNegative, Plant, None, "amplitude of harmonic 2 of the pitch, at knot 3";
        Harmonic2_4 => "harmonic_2_4", "A_2", "N", NonNegative, Plant, None, "amplitude of harmonic 2 of the pitch, at knot 4";
        Harmonic2_5 => "harmonic_2_5", "A_2", "N", NonNegative, Plant, None, "amplitude of harmonic 2 of the pitch, at knot 5";
        Harmonic2_6 => "harmonic_2_6", "A_2", "N", NonNegative, Plant, None, "amplitude of harmonic 2 of the pitch, at knot 6";
        Harmonic2_7 => "harmonic_2_7", "A_2", "N", NonNegative, Plant, None, "amplitude of harmonic 2 of the pitch, at knot 7";
        Harmonic2_8 => "harmonic_2_8", "A_2", "N", NonNegative, Plant, None, "amplitude of harmonic 2 of the pitch, at knot 8";
        Harmonic3_1 => "harmonic_3_1", "A_3", "N", NonNegative, Plant, None, "amplitude of harmonic 3 of the pitch, at knot 1";
        Harmonic3_2 => "harmonic_3_2", "A_3", "N", NonNegative, Plant, None, "amplitude of harmonic 3 of the pitch, at knot 2";
        Harmonic3_3 => "harmonic_3_3", "A_3", "N", NonNegative, Plant, None, "amplitude of harmonic 3 of the pitch, at knot 3";
        Harmonic3_4 => "harmonic_3_4", "A_3", "N", NonNegative, Plant, None, "amplitude of harmonic 3 of the pitch, at knot 4";
        Harmonic3_5 => "harmonic_3_5", "A_3", "N", NonNegative, Plant, None, "amplitude of harmonic 3 of the pitch, at knot 5";
        Harmonic3_6 => "harmonic_3_6", "A_3", "N", NonNegative, Plant, None, "amplitude of harmonic 3 of the pitch, at knot 6";
        Harmonic3_7 => "harmonic_3_7", "A_3", "N", NonNegative, Plant, None, "amplitude of harmonic 3 of the pitch, at knot 7";
        Harmonic3_8 => "harmonic_3_8", "A_3", "N", NonNegative, Plant, None, "amplitude of harmonic 3 of the pitch, at knot 8";
        Harmonic4_1 => "harmonic_4_1", "A_4", "N", NonNegative, Plant, None, "amplitude of harmonic 4 of the pitch, at knot 1";
        Harmonic4_2 => "harmonic_4_2", "A_4", "N", NonNegative, Plant, None, "amplitude of harmonic 4 of the pitch, at knot 2";
        Harmonic4_3 => "harmonic_4_3", "A_4", "N", NonNegative, Plant, None, "amplitude of harmonic 4 of the pitch, at knot 3";
        Harmonic4_4 => "harmonic_4_4", "A_4", "N", NonNegative, Plant, None, "amplitude of harmonic 4 of the pitch, at knot 4";
        Harmonic4_5 => "harmonic_4_5", "A_4", "N", NonNegative, Plant, None, "amplitude of harmonic 4 of the pitch, at knot 5";
        Harmonic4_6 => "harmonic_4_6", "A_4", "N", NonNegative, Plant, None, "amplitude of harmonic 4 of the pitch, at knot 6";
        Harmonic4_7 => "harmonic_4_7", "A_4", "N", NonNegative, Plant, None, "amplitude of harmonic 4 of the pitch, at knot 7";
        Harmonic4_8 => "harmonic_4_8", "A_4", "N", NonNegative, Plant, None, "amplitude of harmonic 4 of the pitch, at knot 8";
        Harmonic5_1 => "harmonic_5_1", "A_5", "N", NonNegative, Plant, None, "amplitude of harmonic 5 of the pitch, at knot 1";
        Harmonic5_2 => "harmonic_5_2", "A_5", "N", NonNegative, Plant, None, "amplitude of harmonic 5 of the pitch, at knot 2";
        Harmonic5_3 => "harmonic_5_3", "A_5", "N", NonNegative, Plant, None, "amplitude of harmonic 5 of the pitch, at knot 3";
        Harmonic5_4 => "harmonic_5_4", "A_5", "N", NonNegative, Plant, None, "amplitude of harmonic 5 of the pitch, at knot 4";
        Harmonic5_5 => "harmonic_5_5", "A_5", "N", NonNegative, Plant, None, "amplitude of harmonic 5 of the pitch, at knot 5";
        Harmonic5_6 => "harmonic_5_6", "A_5", "N", NonNegative, Plant, None, "amplitude of harmonic 5 of the pitch, at knot 6";
        Harmonic5_7 => "harmonic_5_7", "A_5", "N", NonNegative, Plant, None, "amplitude of harmonic 5 of the pitch, at knot 7";
        Harmonic5_8 => "harmonic_5_8", "A_5", "N", NonNegative, Plant, None, "amplitude of harmonic 5 of the pitch, at knot 8";
        BreakawayRatio => "breakaway_ratio", "-", "1", AtLeast(1.0), Plant, Some(1.0), "static over kinetic friction at rest";
        Growth => "growth", "-", "N", NonNegative, Plant, Some(0.0), "force added to both tables by wear; healthy 0";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct TrainFriction<S> {
    knots: Knots<S, SPEEDS>,
    connected: [Curve<S, SPEEDS>; 2],
    screw: [Curve<S, SPEEDS>; 2],
    harmonics: [Curve<S, SPEEDS>; HARMONICS],
    pub breakaway: S,
    growth: S,
}

/// Resistive forces at the ram, kinetic.
#[derive(Clone, Copy, Debug)]
pub struct Resistance<S> {
    /// Of the whole train.
    pub train: S,
    /// Of the screw side alone.
    pub screw: S,
}

impl<S: Scalar> TrainFriction<S> {
    pub fn derive(raw: &[S], lubricant: &Lubricant<S>) -> Self {
        use TrainFrictionParameter as P;
        let knots = Knots::new(std::array::from_fn(|k| raw[P::Speed1 as usize + k]));
        let curve = |first: usize| Curve::new(&knots, &raw[first..first + SPEEDS]);
        let warm = |first: usize| Curve::new(&knots, &lubricant.friction::<SPEEDS>(std::array::from_fn(|k| raw[first + k])));
        Self {
            knots,
            connected: [warm(P::FfmExtension1 as usize), warm(P::FfmRetraction1 as usize)],
            screw: [warm(P::FfExtension1 as usize), warm(P::FfRetraction1 as usize)],
            harmonics: std::array::from_fn(|h| curve(P::Harmonic1_1 as usize + h * SPEEDS)),
            breakaway: raw[P::BreakawayRatio as usize],
            growth: raw[P::Growth as usize],
        }
    }

    /// Resistance at ram speed `speed` and nut position `nut`; `turns` is 2 pi over the pitch. The harmonics modulate the
    /// resistance, so that friction never delivers energy.
    #[inline(always)]
    pub fn at(&self, speed: S, extending: S::Mask, nut: S, turns: S) -> Resistance<S> {
        let reach = self.knots.reach(speed.abs());
        let pick = |tables: &[Curve<S, SPEEDS>; 2]| S::select(extending, tables[0].at(&reach), tables[1].at(&reach));
        let (train, screw) = (pick(&self.connected), pick(&self.screw));
        // cos(n a) by Chebyshev's recursion.
        let (_, cos) = (nut * turns).sin_cos();
        let twice = cos + cos;
        let (mut before, mut now) = (S::one(), cos);
        let mut ripple = self.growth;
        for harmonic in &self.harmonics {
            ripple = harmonic.at(&reach).fma(now, ripple);
            let next = twice * now - before;
            before = now;
            now = next;
        }
        let zero = S::zero();
        Resistance { train: (train + ripple).maximum(zero), screw: (screw + ripple).maximum(zero) }
    }
}
