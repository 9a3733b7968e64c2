//! Supply with current and power limit behind a resistance, feeding the link capacitor.

use crate::scalar::Scalar;
use crate::{choices, kept, variables};

choices! {
    /// What a source does with current that comes back.
    Regeneration { Accept "accept", Block "block" }
}

variables! {
    /// The source and the link.
    SupplyParameter, SUPPLY {
        CurrentLimit => "current_limit", "I_max", "A", Positive, Plant, None, "largest current the source gives";
        PowerLimit => "power_limit", "P_max", "W", Positive, Plant, None, "largest power the source gives";
        Resistance => "resistance", "R_s", "ohm", Positive, Plant, None, "source and harness";
        Capacitance => "capacitance", "C", "F", Positive, Plant, None, "link capacitor";
        Regeneration => "regeneration", "-", "1", Choice(Regeneration::NAMES), Plant, Some(0.0), "does the source take current back, or does the link charge up to the dump resistor";
        DumpVoltage => "dump_voltage", "-", "V", Positive, Plant, None, "link voltage above which the dump resistor conducts (regeneration = block)",
            when(&[Chosen("supply.regeneration", &["block"])]);
        DumpResistance => "dump_resistance", "-", "ohm", Positive, Plant, None, "dump resistor, across the link while that is above dump_voltage",
            when(&[Chosen("supply.regeneration", &["block"])]);
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Supply<S> {
    per_resistance: S,
    current_limit: S,
    power_limit: S,
    pub capacitance: S,
    dt_per_capacitance: S,
    lowest: S,
    dump_voltage: S,
    dump_conductance: S,
}

/// Currents of the link during a step.
#[derive(Clone, Copy, Debug)]
pub struct Link<S> {
    pub source: S,
    pub dump: S,
}

kept!(Link<f64> as Link { source, dump });

impl<S: Scalar> Supply<S> {
    pub fn derive(raw: &[S], dt: S) -> Self {
        use SupplyParameter as P;
        let g = |p: P| raw[p as usize];
        let block = S::mask(Regeneration::read(g(P::Regeneration)) == Regeneration::Block);
        Self {
            per_resistance: S::one() / g(P::Resistance),
            current_limit: g(P::CurrentLimit),
            power_limit: g(P::PowerLimit),
            capacitance: g(P::Capacitance),
            dt_per_capacitance: dt / g(P::Capacitance),
            lowest: S::select(block, S::zero(), S::splat(-1e12)),
            dump_voltage: g(P::DumpVoltage),
            dump_conductance: S::select(block, S::one() / g(P::DumpResistance), S::zero()),
        }
    }

    /// Currents into the link and through the dump resistor.
    #[inline(always)]
    pub fn currents(&self, source: S, link: S) -> Link<S> {
        let limit = self.current_limit.minimum(self.power_limit / source.maximum(S::splat(1e-3)));
        let given = ((source - link) * self.per_resistance).clamp(self.lowest, limit);
        let dump = S::select(self.dump_voltage.lt(link), link * self.dump_conductance, S::zero());
        Link { source: given, dump }
    }

    /// Link voltage after a step in which the bridge drew `bus`.
    #[inline(always)]
    pub fn charge(&self, link: S, currents: &Link<S>, bus: S) -> S {
        let after = self.dt_per_capacitance.fma(currents.source - currents.dump - bus, link);
        after.maximum(S::zero())
    }
}
