//! Faults as a caller names them, resolved to the parameters they move.

use super::{FaultKind, FaultSpec, Op, Profile, Write};
use crate::fault::catalogue::Place;

/// A fault by its names, in SI.
#[derive(Clone, Copy)]
pub struct Named<'a> {
    pub kind: &'a str,
    pub place: &'a str,
    pub severity: f64,
    /// Further numbers of the fault that are given; others have their defaults.
    pub attribute: &'a dyn Fn(&str) -> Option<f64>,
}

impl Named<'_> {
    fn find<'k>(&self, known: &'k [FaultKind]) -> Option<(&'k FaultKind, &'k Place)> {
        let named = |f: &&FaultKind| f.kind == self.kind;
        known.iter().filter(named).find_map(|f| f.places.iter().find(|p| p.name == self.place).map(|p| (f, p)))
    }

    /// Of the faults that a model carries; `index` gives the places of parameters.
    ///
    /// # Errors
    /// The model has no such fault, or not with these numbers.
    pub fn resolved(&self, known: &[FaultKind], index: &dyn Fn(&str) -> Option<usize>, profile: Profile) -> Result<FaultSpec, String> {
        let name = format!("{}@{}", self.kind, self.place);
        let (record, place) = self.find(known).ok_or_else(|| format!("no fault {name} at this fidelity"))?;
        let index = |path: &str| index(path).ok_or_else(|| format!("fault {name} needs {path:?}, which the actuator lacks"));
        let writes = place.targets.iter().map(|t| Ok(Write { index: index(t.path)?, op: t.op })).collect::<Result<Vec<_>, String>>()?;
        let (mut settings, mut period) = (Vec::new(), 0.0);
        for attribute in record.attributes {
            let Some(value) = (self.attribute)(attribute.name).or(attribute.default) else {
                continue;
            };
            if attribute.path.is_empty() {
                period = value;
                continue;
            }
            settings.push((index(attribute.path)?, value));
            if !attribute.flag.is_empty() {
                settings.push((index(attribute.flag)?, 0.0));
            }
        }
        if !record.range.contains(self.severity) {
            return Err(format!("{name}: severity {} is out of range", self.severity));
        }
        if writes.iter().any(|w| w.op == Op::Pulse) && !(period > 0.0 && period.is_finite()) {
            return Err(format!("{name}: period = {period} s must be positive"));
        }
        Ok(FaultSpec { severity: self.severity, profile, writes, settings, period })
    }
}
