//! Features across the seam: their records, and the features of columns.

use crate::describe::dicts;
use crate::seam::{bad, guarded};
use crate::spec::need;
use elevon_core::features::{records, Accumulator, Plan, Role, Settings};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

#[pyfunction]
pub fn feature_records(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    guarded(|| {
        dicts(py, records(), |d, r| {
            d.set_item("name", &r.name)?;
            d.set_item("unit", &r.unit)?;
            d.set_item("family", r.family)?;
            d.set_item("roles", r.roles.iter().map(|role| role.name()).collect::<Vec<_>>())?;
            d.set_item("minimum_rate", r.minimum_rate)?;
            d.set_item("text", &r.text)
        })
    })
}

#[pyfunction]
pub fn feature_roles(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    guarded(|| {
        dicts(py, Role::ALL, |d, role| {
            d.set_item("name", role.name())?;
            d.set_item("text", role.text())
        })
    })
}

fn roles(names: &[String]) -> PyResult<Vec<Role>> {
    names.iter().map(|name| Role::by_name(name).ok_or_else(|| bad(format!("no role {name:?}")))).collect()
}

fn read(d: &Bound<'_, PyDict>) -> PyResult<Plan> {
    let number = |key: &str| -> PyResult<f64> { need(d, key)?.extract() };
    let settings = Settings { rate: number("rate")?, pole_pairs: number("pole_pairs")?, moving_speed: number("moving_speed")? };
    let names: Vec<String> = need(d, "names")?.extract()?;
    let given: Vec<String> = need(d, "roles")?.extract()?;
    Plan::new(&names, &roles(&given)?, settings).map_err(bad)
}

/// The features that a clock is to have instead of rows; its signals are their columns.
pub fn plan(clock: &Bound<'_, PyDict>) -> PyResult<Option<Plan>> {
    match clock.get_item("features")? {
        Some(given) if !given.is_none() => {
            let given = given.cast_into::<PyDict>()?;
            let roles: Vec<String> = need(&given, "roles")?.extract()?;
            let signals = need(clock, "signals")?.len()?;
            if roles.len() != signals {
                return Err(bad(format!("features: {} roles for {signals} signals", roles.len())));
            }
            read(&given).map(Some)
        }
        _ => Ok(None),
    }
}

/// Features of columns, which stand in the order of the plan's roles: the very sums that a running simulation makes.
#[pyfunction]
pub fn features<'py>(
    py: Python<'py>,
    plan: &Bound<'py, PyDict>,
    columns: Vec<PyReadonlyArray1<'py, f64>>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    guarded(|| {
        let slices = columns.iter().map(|c| c.as_slice()).collect::<Result<Vec<_>, _>>()?;
        let roles: Vec<String> = need(plan, "roles")?.extract()?;
        let plan = read(plan)?;
        let rows = slices.first().map_or(0, |c| c.len());
        if roles.len() != slices.len() || slices.iter().any(|c| c.len() != rows) {
            return Err(bad(format!("{} columns for {} roles, or of different lengths", slices.len(), roles.len())));
        }
        let values = py.detach(|| {
            let mut sums = Accumulator::new(&plan);
            sums.push(&plan.columns(slices.iter().copied()));
            sums.finish()
        });
        Ok(PyArray1::from_vec(py, values))
    })
}
