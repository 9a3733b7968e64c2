//! Actuator, leg and airframe make a triangle: the actuator turns about the origin, the leg about `(d, e)`, and the
//! lever arm of the leg carries the rod end (P eqs. 16 to 19; the triangle is solved, not its tangent).

use crate::scalar::Scalar;
use crate::variable::Switch;
use crate::variables;

variables! {
    /// The triangle of actuator, lever arm and airframe.
    LeverParameter, LEVER {
        Arm => "arm", "g_a", "m", Positive, Plant, None, "lever arm of the leg, pivot to rod end";
        PivotX => "pivot_x", "d_a", "m", Any, Plant, None, "pivot of the leg seen from the fixed pivot of the actuator, x";
        PivotY => "pivot_y", "e_a", "m", Any, Plant, None, "pivot of the leg seen from the fixed pivot of the actuator, y";
        LengthRetracted => "length_retracted", "l_min", "m", Positive, Plant, None, "length of the retracted actuator";
        Stroke => "stroke", "S", "m", Positive, Plant, None, "stroke of the ram";
    }
}

variables! {
    /// What hangs on the lever.
    LegParameter, LEG {
        Inertia => "inertia", "J_c", "kg m2", NonNegative, Load, None, "inertia of the leg about its pivot";
        InertiaRateTerm => "inertia_rate_term", "-", "1", Choice(Switch::NAMES), Plant, Some(0.0), "the term -(1/2)(dJ_tot/dtheta) w^2 of a varying inertia, which P omits";
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Lever<S> {
    retracted: S,
    pub stroke: S,
    /// Cosine of the angle at the pivot: (near - l^2) half.
    near: S,
    half: S,
    /// 1 / (D g)^2.
    per_product: S,
    product: S,
    /// Of the line between the pivots.
    inclination: S,
}

/// The lever at one ram position.
#[derive(Clone, Copy, Debug)]
pub struct Arm<S> {
    /// 1 / h^2, h = dx/dalpha.
    pub per_square: S,
    /// d(1/h^2)/dx.
    pub rate: S,
}

impl<S: Scalar> Lever<S> {
    pub fn derive(raw: &[S]) -> Self {
        use LeverParameter as P;
        let g = |p: P| raw[p as usize];
        let (arm, x, y) = (g(P::Arm), g(P::PivotX), g(P::PivotY));
        let square = x * x + y * y;
        let product = square.sqrt() * arm;
        Self {
            retracted: g(P::LengthRetracted),
            stroke: g(P::Stroke),
            near: square + arm * arm,
            half: S::splat(0.5) / product,
            per_product: S::one() / (product * product),
            product,
            inclination: S::atan2_right(y, x.maximum(S::splat(1e-12))),
        }
    }

    #[inline(always)]
    fn cosine(&self, length: S) -> S {
        (self.near - length * length) * self.half
    }

    #[inline(always)]
    pub fn at(&self, ram: S) -> Arm<S> {
        let length = self.retracted + ram;
        let cos = self.cosine(length);
        // h = D g sin(G) / l, the height of the triangle on the actuator's side.
        let per_sine = S::one() / (S::one() - cos * cos);
        let per_square = length * length * per_sine * self.per_product;
        let two = S::splat(2.0);
        let rate = two * length * per_sine * self.per_product * (S::one() - cos * length * length * per_sine / self.product);
        Arm { per_square, rate }
    }

    /// Angle of the leg, growing with the ram position.
    pub fn angle(&self, ram: S) -> S {
        let cos = self.cosine(self.retracted + ram);
        let sine = (S::one() - cos * cos).sqrt();
        S::splat(std::f64::consts::FRAC_PI_2) - S::atan2_right(cos, sine) - self.inclination
    }
}

/// First ram position of the stroke, in steps of a thousandth, at which the triangle does not close.
pub fn opens_at(raw: &[f64]) -> Option<f64> {
    let lever = Lever::derive(raw);
    (0..=1000).map(|i| lever.stroke * i as f64 / 1000.0).find(|&x| lever.cosine(lever.retracted + x).abs() >= 1.0)
}
