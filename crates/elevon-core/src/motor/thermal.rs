//! Thermal network of a motor: winding, surface, ambient air (N 3.2, eq. 1; docs/explanation/theory/thermal.md).
//!
//! The copper heat is summed by the inner loop; the network advances on its own tick with the mean heat of that tick, so
//! no heat is lost between the clocks. Temperatures and the heat given away follow from the same flows: the energy
//! closes to rounding at any tick.

use crate::scalar::Scalar;
use crate::three;
use crate::variable::View;
use crate::{choices, kept, variables};

/// Stefan-Boltzmann constant, W/(m2 K4).
const STEFAN_BOLTZMANN: f64 = 5.670_374_419e-8;
/// Newton steps on the surface temperature; the function is convex, so they converge from any start.
const NEWTON: usize = 12;

choices! {
    ThermalModel { Off "off", QuasiStatic "quasi_static", Dynamic "dynamic" }
}

variables! {
    /// The thermal network of a motor.
    ThermalParameter, THERMAL {
        Model => "model", "-", "1", Choice(ThermalModel::NAMES), Plant, Some(0.0), "off: the winding's temperature is an input; quasi_static: surface without capacity, as printed; dynamic: a housing with capacity";
        WindingMass => "winding_mass", "m", "kg", Positive, Plant, Some(1.0), "mass of the winding",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        WindingHeat => "winding_heat", "c", "J/(kg K)", Positive, Plant, Some(385.0), "specific heat of the winding",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        HousingCapacity => "housing_capacity", "C_h", "J/K", Positive, Plant, Some(1000.0), "heat capacity of the housing (dynamic)",
            when(&[Chosen("thermal.model", &["dynamic"])]);
        WindingToSurface => "winding_to_surface", "R_th", "K/W", Positive, Plant, Some(1.0), "thermal resistance from the winding to the surface",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        Convection => "convection", "h", "W/(m2 K)", NonNegative, Plant, Some(10.0), "heat transfer coefficient of the surface",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        Area => "area", "A", "m2", Positive, Plant, Some(0.1), "cooled surface",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        Emissivity => "emissivity", "epsilon", "1", Unit, Plant, Some(0.9), "emissivity of the surface; 0: no radiation",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        Ambient => "ambient", "T_a", "K", Positive, Plant, Some(293.15), "temperature of the air; without a thermal model, the reported temperature of the surface";
        Warning => "warning", "-", "K", Positive, Controller, Some(403.15), "winding temperature above which the warning is set";
        Trip => "trip", "-", "K", Positive, Controller, Some(428.15), "winding temperature at which the drive opens its bridge and the run ends",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
        SampleTime => "sample_time", "-", "s", Positive, Solver, Some(0.01), "tick of the network",
            when(&[Chosen("thermal.model", &["quasi_static", "dynamic"])]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Network<S> {
    winding_capacity: S,
    /// Zero: the surface has no capacity.
    housing_capacity: S,
    resistance: S,
    convection: S,
    radiation: S,
    ambient: S,
    pub warning: S,
    pub trip: S,
    period: S,
    coefficient: S,
    flux_coefficient: S,
    reference: S,
}

#[derive(Clone, Copy, Debug)]
pub struct NetworkState<S> {
    pub winding: S,
    pub surface: S,
    /// Iron loss at the last tick, J since the start.
    iron: S,
    /// Heat of the phases, of shorted turns and of contacts in the winding since the last tick, J.
    pub collected: [S; 3],
    /// What of it is known to be heat of one phase's copper, J; the rest is even.
    pub windings: [S; 3],
    /// Each phase's temperature above the winding's, K.
    apart: [S; 3],
    /// Heat of the phase that has most, mean of the last tick, W.
    pub hottest: S,
    /// Mean of the last tick, W: phases, shorted turns, contacts, given to the air.
    pub power: [S; 4],
    /// Since the start, J.
    pub heat_in: S,
    pub heat_out: S,
    begin: [S; 2],
    /// 1 once the winding has passed the trip temperature.
    pub over: S,
}

kept!(NetworkState<f64> as NetworkState { winding, surface, iron, collected, windings, apart, hottest, power, heat_in, heat_out, begin, over });

impl<S: Scalar> Network<S> {
    /// `temperature` holds reference, coefficient of the resistance and of the flux; `period` the network's tick, s.
    pub fn derive(raw: &[S], temperature: [S; 3], period: f64) -> Self {
        use ThermalParameter as P;
        let g = |p: P| raw[p as usize];
        let dynamic = S::mask(ThermalModel::read(g(P::Model)) == ThermalModel::Dynamic);
        Self {
            winding_capacity: g(P::WindingMass) * g(P::WindingHeat),
            housing_capacity: S::select(dynamic, g(P::HousingCapacity), S::zero()),
            resistance: g(P::WindingToSurface),
            convection: g(P::Convection) * g(P::Area),
            radiation: S::splat(STEFAN_BOLTZMANN) * g(P::Emissivity) * g(P::Area),
            ambient: g(P::Ambient),
            warning: g(P::Warning),
            trip: g(P::Trip),
            period: S::splat(period),
            reference: temperature[0],
            coefficient: temperature[1],
            flux_coefficient: temperature[2],
        }
    }

    pub fn needed(view: &View<ThermalParameter>) -> bool {
        ThermalModel::read(view.value(ThermalParameter::Model)) != ThermalModel::Off
    }

    /// The given temperatures, the air's where none is given (NaN).
    pub fn start_at(&self, [winding, surface]: [S; 2]) -> NetworkState<S> {
        let or = |given: S| S::select(given.equals(given), given, self.ambient);
        self.start(or(winding), or(surface))
    }

    /// Both nodes at the given temperatures; a surface without capacity follows the winding at once.
    pub fn start(&self, winding: S, surface: S) -> NetworkState<S> {
        let zero = S::zero();
        let quasi = self.housing_capacity.equals(zero);
        let settled = self.surface_after(winding, surface, [zero; 2], zero, zero);
        let surface = S::select(quasi, settled, surface);
        NetworkState {
            winding,
            surface,
            iron: zero,
            collected: [zero; 3],
            windings: [zero; 3],
            apart: [zero; 3],
            hottest: zero,
            power: [zero; 4],
            heat_in: zero,
            heat_out: zero,
            begin: [winding, surface],
            over: zero,
        }
    }

    /// Temperature of the housing, and so of what it holds: the air's without a network.
    #[inline(always)]
    pub fn housing(&self, network: bool, s: &NetworkState<S>) -> S {
        if network {
            s.surface
        } else {
            self.ambient
        }
    }

    /// The air's.
    #[inline(always)]
    pub fn air(&self) -> S {
        self.ambient
    }

    /// Heat to the air at a surface temperature, W.
    #[inline(always)]
    fn lost_to_air(&self, surface: S) -> S {
        let fourth = |t: S| t.square().square();
        self.convection * (surface - self.ambient) + self.radiation * (fourth(surface) - fourth(self.ambient))
    }

    /// Surface temperature at the end of an implicit step: `gain` is its length over the winding's capacity,
    /// `inertia` the housing's capacity over it; heat of the winding and of the iron, which lies at the surface.
    fn surface_after(&self, winding: S, surface: S, [power, iron]: [S; 2], gain: S, inertia: S) -> S {
        let series = self.resistance + gain;
        // The winding's own balance, eliminated: what flows to the surface is (T_w + a P - T_s) / (R + a).
        let driving = winding + gain * power;
        let slope = inertia + S::one() / series + self.convection;
        let mut t = surface;
        for _ in 0..NEWTON {
            let residue = inertia * (t - surface) - (driving - t) / series - iron + self.lost_to_air(t);
            t = t - residue / (slope + S::splat(4.0) * self.radiation * t * t * t);
        }
        t
    }

    /// One tick with the heat collected since the last one; `iron` is the motor's iron loss since the start, J.
    pub fn tick(&self, s: &mut NetworkState<S>, iron: S) {
        let zero = S::zero();
        let quasi = self.housing_capacity.equals(zero);
        let [copper, loops, contact] = three!(|j| s.collected[j] / self.period);
        let power = copper + loops + contact;
        let lost = (iron - s.iron) / self.period;
        s.iron = iron;
        let gain = self.period / self.winding_capacity;
        let surface = self.surface_after(s.winding, s.surface, [power, lost], gain, self.housing_capacity / self.period);
        let through = (s.winding + gain * power - surface) / (self.resistance + gain);
        let out = S::select(quasi, through + lost, self.lost_to_air(surface));
        s.heat_in = s.heat_in + self.period * (power + lost);
        s.heat_out = s.heat_out + self.period * out;
        s.winding = s.winding + gain * (power - through);
        let capacity = S::select(quasi, S::one(), self.housing_capacity);
        s.surface = S::select(quasi, surface, s.surface + self.period / capacity * (through + lost - out));
        self.part_phases(s, power, gain);
        s.collected = [zero; 3];
        s.power = [copper, loops, contact, out];
        s.over = S::select(self.trip.lt(s.winding), S::one(), s.over);
    }

    /// Each phase is a third of the winding with three times its resistance to the surface, none to the others: the mean of
    /// the three is the winding's own node, what they differ by decays with its time constant.
    fn part_phases(&self, s: &mut NetworkState<S>, power: S, gain: S) {
        let (third, three) = (S::splat(1.0 / 3.0), S::splat(3.0));
        let mean = third * (s.windings[0] + s.windings[1] + s.windings[2]);
        let above: [S; 3] = three!(|j| (s.windings[j] - mean) / self.period);
        let per = S::one() / (S::one() + gain / self.resistance);
        s.apart = three!(|j| per * (three * gain).fma(above[j], s.apart[j]));
        s.hottest = third.fma(power, above[0].maximum(above[1]).maximum(above[2]));
        s.windings = [S::zero(); 3];
    }

    /// Temperature of the hottest phase.
    #[inline(always)]
    pub fn hottest(&self, s: &NetworkState<S>) -> S {
        s.winding + s.apart[0].maximum(s.apart[1]).maximum(s.apart[2])
    }

    /// Factors on the winding's resistance (its own temperature) and on the flux (the surface's).
    pub fn factors(&self, s: &NetworkState<S>) -> (S, S) {
        let one = S::one();
        (one + self.coefficient * (s.winding - self.reference), one + self.flux_coefficient * (s.surface - self.reference))
    }

    /// Heat in both nodes above that of the start, J.
    #[inline(always)]
    pub fn stored(&self, s: &NetworkState<S>) -> S {
        self.winding_capacity * (s.winding - s.begin[0]) + self.housing_capacity * (s.surface - s.begin[1])
    }

    /// 1 while the winding is above its warning.
    #[inline(always)]
    pub fn warns(&self, s: &NetworkState<S>) -> S {
        S::indicator(self.warning.lt(s.winding))
    }
}
