//! Three-phase star with floating neutral, faults in the winding and the air gap included in
//! their healthy form (T2; reference sheet 1.5).

use super::air_gap::AirGap;
use super::pole::WeakPole;
use super::short::{Contacts, KINDS};
use crate::scalar::{apart, three_phase, Kernel, Scalar};
use crate::three;
use crate::variable::acts::When;
use crate::variable::View;
use crate::{choices, kept, variables};

choices! {
    EmfShape { Sinusoidal "sinusoidal", Trapezoidal "trapezoidal" }
    ShortModel { Reduced "reduced", Loop "loop" }
    EccentricityLaw { Published "published", Periodic "periodic" }
}

/// Some phase has lost turns.
const SHORTED: When = When::Either(&[When::Away("motor.turns_a", 1.0), When::Away("motor.turns_b", 1.0), When::Away("motor.turns_c", 1.0)]);
/// The rotor turns or stands out of centre.
const ECCENTRIC: When = When::Either(&[
    When::Away("motor.eccentricity_static", 0.0),
    When::Away("motor.eccentricity_dynamic", 0.0),
    When::Away("motor.unbalance_inertia", 0.0),
]);
/// The winding may leave its reference temperature.
const WARM: When = When::Either(&[
    When::Chosen("thermal.model", &["quasi_static", "dynamic"]),
    When::Differ("motor.winding_temperature", "motor.reference_temperature"),
]);

variables! {
    /// The motor.
    MotorParameter, MOTOR {
        PolePairs => "pole_pairs", "p", "1", Count(1.0, f64::INFINITY), Plant, None, "pole pairs";
        Inertia => "inertia", "J_m", "kg m2", Positive, Plant, None, "rotor inertia";
        WindingResistance => "winding_resistance", "R", "ohm", Positive, Plant, None, "phase resistance at the reference temperature";
        WindingInductance => "winding_inductance", "L", "H", Positive, Plant, None, "phase inductance, mutual part included";
        EmfConstant => "emf_constant", "k", "V s/rad", Positive, Plant, None, "peak phase EMF per mechanical rad/s; torque per peak ampere is 1.5 k";
        TorqueLimit => "torque_limit", "T_max", "N m", Positive, Plant, None, "the flux saturates the torque at this value";
        EmfShape => "emf_shape", "-", "1", Choice(EmfShape::NAMES), Plant, Some(0.0), "shape of the EMF over the electrical angle";
        EmfFlatWidth => "emf_flat_width", "beta", "rad", Between(0.0, 3.0), Plant, Some(2.094_395_102_393_195_3), "width of the trapezoid's flat",
            when(&[Chosen("motor.emf_shape", &["trapezoidal"])]);
        TurnsA => "turns_a", "N_a", "1", Fraction, Plant, Some(1.0), "healthy fraction of the turns of phase a";
        TurnsB => "turns_b", "N_b", "1", Fraction, Plant, Some(1.0), "healthy fraction of the turns of phase b";
        TurnsC => "turns_c", "N_c", "1", Fraction, Plant, Some(1.0), "healthy fraction of the turns of phase c";
        FluxFraction => "flux_fraction", "-", "1", Fraction, Plant, Some(1.0), "healthy 1; less: the magnets have lost flux";
        EccentricityStatic => "eccentricity_static", "zeta", "1", Unit, Plant, Some(0.0), "amplitude of the static eccentricity";
        EccentricityStaticPhase => "eccentricity_static_phase", "phi", "rad", Any, Plant, Some(0.0), "its phase angle: electrical in the published law, of the narrow gap round the stator in the periodic one",
            when(&[Away("motor.eccentricity_static", 0.0)]);
        EccentricityDynamic => "eccentricity_dynamic", "zeta_d", "1", Unit, Plant, Some(0.0), "dynamic eccentricity, fraction of the air gap; its modulation turns with the shaft";
        EccentricityDynamicPhase => "eccentricity_dynamic_phase", "phi_d", "rad", Any, Plant, Some(0.0), "its mechanical phase angle",
            when(&[Away("motor.eccentricity_dynamic", 0.0)]);
        EccentricityLaw => "eccentricity_law", "-", "1", Choice(EccentricityLaw::NAMES), Plant, Some(0.0), "published: the papers' modulation of k_j, whose static part has an EMF with a mean over a turn (0.43 zeta k omega in b and c); periodic: the slope of a flux that is periodic over a turn, unequal amplitudes and a turning part",
            when(&[ECCENTRIC]);
        OpenA => "open_a", "-", "1", Flag, Plant, Some(0.0), "1: phase a is interrupted (from its next current zero on)";
        OpenB => "open_b", "-", "1", Flag, Plant, Some(0.0), "1: phase b is interrupted (from its next current zero on)";
        OpenC => "open_c", "-", "1", Flag, Plant, Some(0.0), "1: phase c is interrupted (from its next current zero on)";
        ShortModel => "short_model", "-", "1", Choice(ShortModel::NAMES), Plant, Some(0.0), "shorted turns only missing (the paper), or a loop of their own with circulating current",
            when(&[SHORTED]);
        ShortCoupling => "short_coupling", "kappa", "1", Unit, Plant, Some(0.9), "magnetic coupling of shorted and healthy turns of a phase: mutual inductance kappa N mu L",
            when(&[SHORTED, Chosen("motor.short_model", &["loop"])]);
        ShortContactResistance => "short_contact_resistance", "R_c", "ohm", NonNegative, Plant, Some(0.0), "resistance of the short itself; without limit it is the healthy motor",
            when(&[SHORTED, Chosen("motor.short_model", &["loop"])]);
        WindingTemperature => "winding_temperature", "T_w", "K", Positive, Plant, Some(293.15), "temperature of the winding, an input unless a thermal network drives it", when(&[Chosen("thermal.model", &["off"])]);
        ReferenceTemperature => "reference_temperature", "T_0", "K", Positive, Plant, Some(293.15), "temperature at which the resistance is given",
            when(&[Either(&[Away("motor.temperature_coefficient", 0.0), Away("motor.flux_temperature_coefficient", 0.0)])]);
        TemperatureCoefficient => "temperature_coefficient", "alpha", "1/K", NonNegative, Plant, Some(0.0), "relative rise of the resistance per kelvin",
            when(&[WARM]);
        FluxTemperatureCoefficient => "flux_temperature_coefficient", "alpha_k", "1/K", Any, Plant, Some(0.0), "relative change of the EMF constant per kelvin of winding temperature",
            when(&[WARM]);
        ElectricalOffset => "electrical_offset", "theta_0", "rad", Any, Plant, Some(0.0), "electrical angle at the rotor's zero";
    }
}

/// What of the motor needs the detailed step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct MotorStructure {
    pub trapezoidal: bool,
    pub shorted_loop: bool,
    pub static_eccentricity: bool,
    pub dynamic_eccentricity: bool,
    /// By the law of a periodic flux.
    pub periodic: bool,
    pub weak_pole: bool,
}

impl MotorStructure {
    pub fn read(view: &View<MotorParameter>) -> Self {
        use MotorParameter as P;
        Self {
            trapezoidal: EmfShape::read(view.value(P::EmfShape)) == EmfShape::Trapezoidal,
            shorted_loop: ShortModel::read(view.value(P::ShortModel)) == ShortModel::Loop,
            static_eccentricity: view.away(P::EccentricityStatic),
            dynamic_eccentricity: view.away(P::EccentricityDynamic),
            periodic: EccentricityLaw::read(view.value(P::EccentricityLaw)) == EccentricityLaw::Periodic,
            weak_pole: false,
        }
    }

    /// An unbalanced rotor turns eccentrically.
    pub fn with_unbalance(self, unbalance: bool) -> Self {
        Self { dynamic_eccentricity: self.dynamic_eccentricity || unbalance, ..self }
    }

    /// One pole pair may be weaker than the others.
    pub fn with_weak_pole(self, weak_pole: bool) -> Self {
        Self { weak_pole, ..self }
    }

    /// Do the coefficients follow the published static law?
    pub fn modulated(&self) -> bool {
        self.static_eccentricity && !self.periodic
    }

    /// Does it need more than the plain step? That knows the static eccentricity.
    pub fn detailed(&self) -> bool {
        let Self { trapezoidal, shorted_loop: _, static_eccentricity: _, dynamic_eccentricity, periodic: _, weak_pole } = *self;
        trapezoidal || dynamic_eccentricity || weak_pole
    }
}

/// Is some phase interrupted at some time?
pub fn interrupted(view: &View<MotorParameter>) -> bool {
    view.any_away([MotorParameter::OpenA, MotorParameter::OpenB, MotorParameter::OpenC])
}

/// Do resistance or flux follow the temperature?
pub fn warms(view: &View<MotorParameter>) -> bool {
    view.any_away([MotorParameter::TemperatureCoefficient, MotorParameter::FluxTemperatureCoefficient])
}

#[derive(Clone, Copy, Debug)]
pub struct Star<S> {
    pub pole_pairs: S,
    offset: S,
    pub emf_constant: [S; 3],
    pub resistance: [S; 3],
    pub per_inductance: [S; 3],
    /// Weight of each phase in the neutral voltage, and its share with all connected.
    pub weight: [S; 3],
    neutral_weight: [S; 3],
    torque_limit: S,
    gap: AirGap<S>,
    flat_slope: S,
    pub open: [S; 3],
    /// Solver step over the inductance.
    pub dt_per_inductance: [S; 3],
}

/// Coefficients with a share of the flux: apart, so that a step that needs none does not wait for the share.
struct Weakened<S> {
    k: [S; 3],
    share: S,
}

impl<S: Scalar> Kernel for Weakened<S> {
    type Output = [S; 3];
    #[inline(always)]
    fn run(self) -> [S; 3] {
        three!(|j| self.share * self.k[j])
    }
}

#[derive(Clone, Copy, Debug)]
pub struct StarState<S> {
    /// Ampere-turns per turn of the phases: their currents, but for contacts inside the winding (`short`).
    pub current: [S; 3],
    /// Currents of the contacts.
    pub contact: Contacts<S>,
    /// Factors by which temperature changes resistance and EMF constant.
    pub resistance_factor: S,
    pub flux_factor: S,
}

kept!(StarState<f64> as StarState { current, contact, resistance_factor, flux_factor });

fn phases<S: Scalar>(raw: &[S], first: MotorParameter) -> [S; 3] {
    three!(|j| raw[first as usize + j])
}

impl<S: Scalar> Star<S> {
    pub fn derive(raw: &[S], structure: &MotorStructure, dt: S) -> Self {
        use MotorParameter as P;
        let g = |p: P| raw[p as usize];
        let one = S::one();
        // Turns shorted in a loop of their own are still there.
        let turns = if structure.shorted_loop { [one; 3] } else { phases(raw, P::TurnsA) };
        let k = g(P::EmfConstant) * g(P::FluxFraction);
        let per_inductance: [S; 3] = three!(|j| one / (turns[j] * turns[j] * g(P::WindingInductance)));
        let total = per_inductance[0] + per_inductance[1] + per_inductance[2];
        let gap = AirGap::derive(raw);
        let even: [S; 3] = three!(|j| turns[j] * k);
        let amplitude = gap.amplitudes();
        let pi = S::splat(std::f64::consts::PI);
        Self {
            pole_pairs: g(P::PolePairs),
            offset: g(P::ElectricalOffset),
            emf_constant: if structure.periodic { three!(|j| even[j] * amplitude[j]) } else { even },
            resistance: three!(|j| turns[j] * g(P::WindingResistance)),
            per_inductance,
            weight: per_inductance,
            dt_per_inductance: three!(|j| dt * per_inductance[j]),
            neutral_weight: three!(|j| per_inductance[j] / total),
            torque_limit: g(P::TorqueLimit),
            gap,
            flat_slope: pi / (pi - g(P::EmfFlatWidth)),
            open: phases(raw, P::OpenA),
        }
    }

    /// The same winding with the resistance's voltage taken at the middle of a step: of second order in it.
    ///
    /// (i' - i) L / dt = u - R (i' - i) / 2 with u the drop at the start, so that each phase's gain dt / L becomes
    /// (dt / L) / (1 + R dt / 2 L), and so does its weight in the neutral. What warm copper has above the cold one's
    /// resistance is left out of this gain, not of u: the current settles where it should.
    pub fn at_the_middle(&self) -> Self {
        let gain: [S; 3] = three!(|j| {
            let per = self.dt_per_inductance[j];
            per / (S::splat(0.5) * per).fma(self.resistance[j], S::one())
        });
        let total = gain[0] + gain[1] + gain[2];
        Self { dt_per_inductance: gain, weight: gain, neutral_weight: three!(|j| gain[j] / total), ..*self }
    }

    /// The same winding over a share of a step.
    #[inline(always)]
    pub fn over(&self, share: S) -> Self {
        Self { dt_per_inductance: three!(|j| share * self.dt_per_inductance[j]), ..*self }
    }

    /// Adds a dynamic eccentricity.
    pub fn add_eccentricity(&mut self, added: (S, S)) {
        self.gap.add(added);
    }

    #[inline(always)]
    pub fn electrical_angle(&self, theta: S) -> S {
        self.pole_pairs.fma(theta, self.offset)
    }

    /// k_j with an even gap (sheet 1.5): `shape` is f of the three phase angles.
    #[inline(always)]
    pub fn even_coefficients(&self, shape: [S; 3]) -> [S; 3] {
        three!(|j| self.emf_constant[j] * shape[j])
    }

    /// k_j at a rotor position, whose electrical angle has this sine and cosine, with all that modulates them. The detailed
    /// `flux` factor is the magnets', warm.
    #[inline(always)]
    pub fn coefficients<const FULL: bool>(
        &self,
        structure: &MotorStructure,
        pole: Option<&WeakPole<S>>,
        position: S,
        [sin, cos]: [S; 2],
        flux: Option<S>,
    ) -> [S; 3] {
        let (mut shape, across) = three_phase(sin, cos);
        if !FULL || !(structure.detailed() || flux.is_some()) {
            let even = self.even_coefficients(shape);
            if !structure.modulated() {
                return even;
            }
            let gap = self.gap.published(sin, cos);
            return three!(|j| even[j] * gap[j]);
        }
        let mut gap = if structure.modulated() { self.gap.published(sin, cos) } else { [S::one(); 3] };
        let angle = self.electrical_angle(position);
        if structure.trapezoidal {
            shape = self.trapezoid(angle);
        }
        let mut slope = None;
        if structure.dynamic_eccentricity {
            let turning = self.gap.turning(position);
            gap = three!(|j| gap[j] * (S::one() + turning.0[j]));
            slope = structure.periodic.then_some(turning.1);
        }
        if let (true, Some(pole)) = (structure.weak_pole, pole) {
            let passing = pole.gap(position);
            // Beside a turning flux the weak pole's own loss: a product of both would have a mean over a turn.
            gap = if structure.periodic { three!(|j| gap[j] + (passing[j] - S::one())) } else { three!(|j| gap[j] * passing[j]) };
        }
        if let Some(warm) = flux {
            gap = three!(|j| gap[j] * warm);
        }
        let k: [S; 3] = three!(|j| self.emf_constant[j] * shape[j] * gap[j]);
        let Some(slope) = slope else { return k };
        let linked = if structure.trapezoidal { self.trapezoid_flux(angle) } else { three!(|j| -across[j]) };
        let share = self.gap.per_pole_pairs * flux.unwrap_or(S::one());
        three!(|j| (self.emf_constant[j] * linked[j] * slope[j]).fma(share, k[j]))
    }

    /// Trapezoid of the three phase angles theta_e - 2 pi (j-1)/3: a triangle cut at +-1.
    #[inline(always)]
    pub fn trapezoid(&self, angle: S) -> [S; 3] {
        three!(|j| {
            let turns = angle * S::splat(1.0 / std::f64::consts::TAU) - S::splat(j as f64 / 3.0) + S::splat(0.25);
            let triangle = S::one() - S::splat(4.0) * (turns - turns.floor() - S::splat(0.5)).abs();
            (triangle * self.flat_slope).clamp_abs(S::one())
        })
    }

    /// F of the three phase angles, whose slope is the trapezoid: parabolas round its peaks, where the trapezoid crosses zero.
    #[inline(always)]
    pub fn trapezoid_flux(&self, angle: S) -> [S; 3] {
        let (half, quarter_turn) = (S::splat(0.5), S::splat(std::f64::consts::FRAC_PI_2));
        let width = quarter_turn / self.flat_slope;
        let peak = quarter_turn - half * width;
        three!(|j| {
            let turns = angle * S::splat(1.0 / std::f64::consts::TAU) - S::splat(j as f64 / 3.0) + half;
            // 1 where the trapezoid rises through zero, -1 where it falls.
            let triangle = S::one() - S::splat(4.0) * (turns - turns.floor() - half).abs();
            let distance = (S::one() - triangle.abs()) * quarter_turn;
            let inside = distance.minimum(width);
            let drop = half * inside * inside / width + (distance - inside);
            -triangle.signed(peak - drop)
        })
    }

    /// v_n of three connected phases.
    #[inline(always)]
    pub fn neutral(&self, drop: [S; 3]) -> S {
        let w = &self.neutral_weight;
        w[0].fma(drop[0], w[1].fma(drop[1], w[2] * drop[2]))
    }

    /// Phase currents after a step of explicit Euler; `drop` is terminal voltage less EMF and R i.
    #[inline(always)]
    pub fn currents_after(&self, current: [S; 3], drop: [S; 3], neutral: S) -> [S; 3] {
        three!(|j| self.dt_per_inductance[j].fma(drop[j] - neutral, current[j]))
    }

    /// Torque before saturation.
    #[inline(always)]
    pub fn torque(&self, k: [S; 3], current: [S; 3]) -> S {
        k[0].fma(current[0], k[1].fma(current[1], k[2] * current[2]))
    }

    #[inline(always)]
    pub fn saturate(&self, torque: S) -> S {
        torque.clamp_abs(self.torque_limit)
    }

    /// Share of the flux that is left where it would make more than the largest torque: torque and EMF fall alike, and so the
    /// power that leaves the windings is the shaft's.
    #[inline(always)]
    pub fn unsaturated(&self, torque: S) -> S {
        let size = torque.abs();
        let beyond = self.torque_limit.lt(size);
        S::select(beyond, self.torque_limit / S::select(beyond, size, S::one()), S::one())
    }

    /// Is there such a share, in any lane?
    #[inline(always)]
    pub fn saturates(&self, torque: S) -> bool {
        S::any(self.torque_limit.lt(torque.abs()))
    }

    /// k_j as these currents leave them.
    #[inline(always)]
    pub fn under_load(&self, k: [S; 3], current: [S; 3]) -> [S; 3] {
        let torque = self.torque(k, current);
        if !self.saturates(torque) {
            return k;
        }
        apart::<S, _>(Weakened { k, share: self.unsaturated(torque) })
    }
}

impl<S: Scalar> StarState<S> {
    pub fn initial() -> Self {
        Self { current: [S::zero(); 3], contact: [[S::zero(); 3]; KINDS], resistance_factor: S::one(), flux_factor: S::one() }
    }

    /// Sets the temperature factors for a winding at `temperature` (K).
    pub fn heat(&mut self, raw: &[S], temperature: S) {
        use MotorParameter as P;
        let rise = temperature - raw[P::ReferenceTemperature as usize];
        self.resistance_factor = S::one() + raw[P::TemperatureCoefficient as usize] * rise;
        self.flux_factor = S::one() + raw[P::FluxTemperatureCoefficient as usize] * rise;
    }
}
