//! Where a parameter acts: in which fidelities, and under which values of others. A fault acts where the parameters do
//! that it moves, so neither is written twice.

use super::{Group, Range, Variable};

crate::choices! {
    /// The fidelities of every actuator, in the order of their names.
    Fidelity { High "high", Low "low" }
}

/// What must hold for a parameter to act. Paths are whole ones; of a choice that a wiring lacks the condition holds, a number
/// that it lacks is at rest.
#[derive(Clone, Copy, Debug)]
pub enum When {
    /// The choice is one of these.
    Chosen(&'static str, &'static [&'static str]),
    /// The number is away from this value, now or by a fault.
    Away(&'static str, f64),
    /// The two numbers differ.
    Differ(&'static str, &'static str),
    Either(&'static [When]),
    /// Required of one fidelity only.
    In(Fidelity, &'static [When]),
}

/// Where a parameter acts.
#[derive(Clone, Copy, Debug)]
pub struct Acts {
    /// Why the fidelities do not carry it; empty: they do.
    not_modelled: [&'static str; 2],
    /// All of these must hold.
    pub when: &'static [When],
}

/// In both fidelities, whatever the other parameters are.
pub const ALWAYS: Acts = Acts { not_modelled: [""; 2], when: &[] };

/// In the switching model only, and why not in the reduced-order model.
pub const fn high_only(reason: &'static str) -> Acts {
    Acts { not_modelled: ["", reason], when: &[] }
}

/// In the reduced-order model only, and why not in the switching model.
pub const fn low_only(reason: &'static str) -> Acts {
    Acts { not_modelled: [reason, ""], when: &[] }
}

/// In no fidelity, and why.
pub const fn nowhere(reason: &'static str) -> Acts {
    Acts { not_modelled: [reason; 2], when: &[] }
}

/// In both fidelities while all of `conditions` hold.
pub const fn when(conditions: &'static [When]) -> Acts {
    ALWAYS.when(conditions)
}

impl Acts {
    pub const fn when(self, conditions: &'static [When]) -> Self {
        Self { when: conditions, ..self }
    }

    /// Why a fidelity does not carry the parameter, if so.
    pub fn not_modelled(&self, fidelity: Fidelity) -> Option<&'static str> {
        Some(self.not_modelled[fidelity as usize]).filter(|reason| !reason.is_empty())
    }
}

/// The parameters of a wiring as they stand in a run.
pub struct Standing<'a> {
    pub groups: &'a [Group],
    pub raw: &'a [f64],
    /// Faults will move the parameter.
    pub touched: &'a [bool],
    pub fidelity: Fidelity,
}

/// The records of a wiring with their paths, in the order of its vector.
pub fn records(groups: &[Group]) -> impl Iterator<Item = (String, &'static Variable)> + '_ {
    groups.iter().flat_map(|g| g.variables.iter().enumerate().map(|(i, v)| (g.path(i), v)))
}

impl Standing<'_> {
    /// The place and record of a path; without writing out the paths of all records, since every run needs it.
    fn find(&self, path: &str) -> Option<(usize, &'static Variable)> {
        let mut begin = 0;
        for group in self.groups {
            let tail = if group.prefix.is_empty() { Some(path) } else { path.strip_prefix(group.prefix).and_then(|p| p.strip_prefix('.')) };
            if let Some(i) = tail.and_then(|tail| group.variables.iter().position(|v| v.path == tail)) {
                return Some((begin + i, &group.variables[i]));
            }
            begin += group.variables.len();
        }
        None
    }

    fn away(&self, path: &str, neutral: f64) -> bool {
        self.find(path).is_some_and(|(i, v)| v.range.differ(self.raw[i], neutral) || self.touched[i])
    }

    fn chosen(&self, path: &str, names: &[&str]) -> bool {
        self.find(path).is_none_or(|(i, v)| v.range.choice(self.raw[i]).is_none_or(|name| names.contains(&name)))
    }

    fn holds(&self, condition: &When) -> bool {
        match *condition {
            When::Chosen(path, names) => self.chosen(path, names),
            When::Away(path, neutral) => self.away(path, neutral),
            When::Differ(a, b) => match (self.find(a), self.find(b)) {
                (Some((i, _)), Some((j, _))) => self.raw[i] != self.raw[j] || self.touched[i] || self.touched[j],
                _ => true,
            },
            When::Either(some) => some.iter().any(|c| self.holds(c)),
            When::In(fidelity, all) => fidelity != self.fidelity || all.iter().all(|c| self.holds(c)),
        }
    }

    /// Why the parameter of this record does not act in the run; `None`: it does.
    pub fn idle(&self, variable: &Variable) -> Option<String> {
        if let Some(reason) = variable.acts.not_modelled(self.fidelity) {
            return Some(format!("not carried at fidelity {}: {reason}", Fidelity::NAMES[self.fidelity as usize]));
        }
        let failed = variable.acts.when.iter().find(|c| !self.holds(c))?;
        let here = match *failed {
            When::Chosen(path, _) => self.find(path).and_then(|(i, v)| v.range.choice(self.raw[i])).map(|name| format!(" (here {name})")),
            _ => None,
        };
        Some(format!("acts only with {failed}{}", here.unwrap_or_default()))
    }

    /// Every parameter that does not act in the run, and why; of some `paths` only, where they are given.
    pub fn not_acting(&self, paths: Option<&[String]>) -> Vec<(String, String)> {
        match paths {
            None => records(self.groups).filter_map(|(path, v)| Some((path, self.idle(v)?))).collect(),
            Some(paths) => paths.iter().filter_map(|path| Some((path.clone(), self.idle(self.find(path)?.1)?))).collect(),
        }
    }
}

fn joined(f: &mut std::fmt::Formatter<'_>, all: &[When], word: &str) -> std::fmt::Result {
    for (i, one) in all.iter().enumerate() {
        write!(f, "{}{one}", if i > 0 { word } else { "" })?;
    }
    Ok(())
}

impl std::fmt::Display for When {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Chosen(path, names) => write!(f, "{path} = {}", names.join(" or ")),
            Self::Away(path, neutral) => write!(f, "{path} away from {neutral}"),
            Self::Differ(a, b) => write!(f, "{a} away from {b}"),
            Self::Either(some) => joined(f, some, " or "),
            Self::In(fidelity, all) => {
                joined(f, all, " and ")?;
                write!(f, " (fidelity {})", Self::name(fidelity))
            }
        }
    }
}

impl When {
    fn name(fidelity: Fidelity) -> &'static str {
        Fidelity::NAMES[fidelity as usize]
    }
}

impl Range {
    /// The name of a choice; `None` for a number.
    pub fn choice(self, value: f64) -> Option<&'static str> {
        match self {
            Self::Choice(names) => names.get(value as usize).copied(),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::KINDS;

    /// Paths and names that a condition names.
    fn paths(all: &[When], out: &mut Vec<(&'static str, &'static [&'static str])>) {
        for one in all {
            match *one {
                When::Chosen(path, names) => out.push((path, names)),
                When::Away(path, _) => out.push((path, &[])),
                When::Differ(a, b) => out.extend([(a, &[] as &[&str]), (b, &[])]),
                When::Either(more) | When::In(_, more) => paths(more, out),
            }
        }
    }

    /// A misspelt path would hold everywhere: each stands in some wiring, and its choices there.
    #[test]
    fn conditions_ask_for_what_exists() {
        let every: Vec<_> = KINDS.iter().flat_map(|k| records(k.fidelities[0].1.groups()).collect::<Vec<_>>()).collect();
        let mut conditions = Vec::new();
        every.iter().for_each(|(_, v)| paths(v.acts.when, &mut conditions));
        assert!(!conditions.is_empty());
        for (path, names) in conditions {
            let found = every.iter().find(|(p, _)| p == path);
            let (_, v) = found.unwrap_or_else(|| panic!("{path} stands in no wiring"));
            match v.range {
                Range::Choice(known) => assert!(names.iter().all(|n| known.contains(n)), "{path}: {names:?}"),
                _ => assert!(names.is_empty(), "{path} is no choice"),
            }
        }
    }
}
