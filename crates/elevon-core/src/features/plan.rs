//! Which features of which columns; and their sums.

use super::bands::{Bands, Spectrum};
use super::catalogue::{records, Family, Record, FAMILIES};
use super::friction::Friction;
use super::level::Level;
use super::lost_motion::LostMotion;
use super::orders::Orders;
use super::phases::Phases;
use super::rows::{Columns, Role};
use super::slow::{Switching, Temperature};
use crate::scalar::{best, Kernel};
use std::sync::Arc;

/// What the features need to know besides the rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Rows per second.
    pub rate: f64,
    pub pole_pairs: f64,
    /// Motor speed in rad/s above which the motor counts as moving.
    pub moving_speed: f64,
}

/// The features wanted, and where they come from.
#[derive(Clone, Debug)]
pub struct Plan {
    settings: Settings,
    /// Role of each column of a row.
    roles: Vec<Role>,
    /// Families that are summed up, by their place.
    families: Vec<usize>,
    /// Family among `families` and place in it of each feature, as requested.
    outputs: Vec<(usize, usize)>,
    spectrum: Option<Arc<Spectrum>>,
}

impl Plan {
    /// Errors name the feature and what it lacks.
    pub fn new(names: &[String], roles: &[Role], settings: Settings) -> Result<Self, String> {
        let named = |name: &String| records().iter().find(|r| r.name == *name).ok_or_else(|| format!("no feature {name:?}"));
        let wanted = names.iter().map(named).collect::<Result<Vec<&Record>, String>>()?;
        for record in &wanted {
            check(record, roles, &settings)?;
        }
        let mut families: Vec<usize> = wanted.iter().map(|r| r.place.0).collect();
        families.sort_unstable();
        families.dedup();
        let outputs = wanted.iter().map(|r| (families.partition_point(|&f| f < r.place.0), r.place.1)).collect();
        let banded = families.iter().any(|&f| matches!(FAMILIES[f], Family::Bands(_)));
        let spectrum = banded.then(|| Arc::new(Spectrum::new(settings.rate)));
        Ok(Self { settings, roles: roles.to_vec(), families, outputs, spectrum })
    }

    /// Number of features.
    pub fn len(&self) -> usize {
        self.outputs.len()
    }

    pub fn is_empty(&self) -> bool {
        self.outputs.is_empty()
    }

    /// The columns of a block of rows, which stand in the order of the roles given.
    pub fn columns<'a>(&self, values: impl Iterator<Item = &'a [f64]>) -> Columns<'a> {
        let mut columns = Columns::default();
        for (&role, values) in self.roles.iter().zip(values) {
            columns.set(role, values);
        }
        columns
    }
}

fn check(record: &Record, roles: &[Role], settings: &Settings) -> Result<(), String> {
    let Settings { rate, pole_pairs, moving_speed } = *settings;
    if let Some(role) = record.roles.iter().find(|role| !roles.contains(role)) {
        return Err(format!("{}: there is no {} among the columns", record.name, role.name()));
    }
    if !(rate > 0.0 && rate.is_finite()) {
        return Err(format!("rate: {rate} Hz is not a positive number"));
    }
    if rate < record.minimum_rate {
        return Err(format!("{}: needs a rate of at least {} Hz, {rate} Hz given", record.name, record.minimum_rate));
    }
    if !(pole_pairs >= 1.0 && pole_pairs.is_finite()) {
        return Err(format!("pole_pairs: {pole_pairs} is below 1"));
    }
    if !(moving_speed >= 0.0 && moving_speed.is_finite()) {
        return Err(format!("moving_speed: {moving_speed} rad/s is no number from 0 on"));
    }
    Ok(())
}

/// One family's sums.
#[derive(Clone, Debug)]
enum Sums {
    Level(Level),
    Friction(Friction),
    LostMotion(LostMotion),
    Orders(Box<Orders>),
    Phases(Phases),
    Bands(Bands),
    Temperature(Temperature),
    Switching(Switching),
}

/// The sums of one motion: of a size that does not depend on its length.
#[derive(Clone, Debug)]
pub struct Accumulator {
    sums: Vec<Sums>,
    outputs: Vec<(usize, usize)>,
}

/// With the processor's fused operations where it has them; the bits are the same.
struct Push<'a>(&'a mut [Sums], &'a Columns<'a>);

impl Kernel for Push<'_> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        for sums in self.0 {
            match sums {
                Sums::Level(s) => s.push(self.1),
                Sums::Friction(s) => s.push(self.1),
                Sums::LostMotion(s) => s.push(self.1),
                Sums::Orders(s) => s.push(self.1),
                Sums::Phases(s) => s.push(self.1),
                Sums::Bands(s) => s.push(self.1),
                Sums::Temperature(s) => s.push(self.1),
                Sums::Switching(s) => s.push(self.1),
            }
        }
    }
}

impl Accumulator {
    pub fn new(plan: &Plan) -> Self {
        let Settings { rate, pole_pairs, moving_speed } = plan.settings;
        let start = |&family: &usize| {
            Some(match FAMILIES[family] {
                Family::Level(signal) => Sums::Level(Level::new(signal, rate)),
                Family::Friction => Sums::Friction(Friction::new(moving_speed)),
                Family::LostMotion => Sums::LostMotion(LostMotion::new(moving_speed)),
                Family::Orders(signal) => Sums::Orders(Box::new(Orders::new(signal, pole_pairs))),
                Family::Phases => Sums::Phases(Phases::new(pole_pairs)),
                Family::Bands(signal) => Sums::Bands(Bands::new(signal, plan.spectrum.clone()?)),
                Family::Temperature => Sums::Temperature(Temperature::new()),
                Family::Switching => Sums::Switching(Switching::new(rate)),
            })
        };
        Self { sums: plan.families.iter().filter_map(start).collect(), outputs: plan.outputs.clone() }
    }

    /// Takes the next rows.
    pub fn push(&mut self, rows: &Columns<'_>) {
        best(Push(&mut self.sums, rows));
    }

    /// The features, in the order in which they were requested; NaN where the rows do not give one.
    pub fn finish(&self) -> Vec<f64> {
        let mut values = vec![Vec::new(); self.sums.len()];
        for (sums, out) in self.sums.iter().zip(&mut values) {
            match sums {
                Sums::Level(s) => s.finish(out),
                Sums::Friction(s) => s.finish(out),
                Sums::LostMotion(s) => s.finish(out),
                Sums::Orders(s) => s.finish(out),
                Sums::Phases(s) => s.finish(out),
                Sums::Bands(s) => s.finish(out),
                Sums::Temperature(s) => s.finish(out),
                Sums::Switching(s) => s.finish(out),
            }
        }
        self.outputs.iter().map(|&(family, i)| values[family][i]).collect()
    }
}
