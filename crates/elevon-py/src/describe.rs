//! What the core knows of its actuators, as plain dictionaries.

use crate::seam::{bad, guarded};
use crate::spec::{model, vector, Resolver};
use elevon_core::command::{self, Term, Wave};
use elevon_core::fault::{profiles as fault_profiles, Attribute};
use elevon_core::registry::KINDS;
use elevon_core::solver::{derivatives, Width};
use elevon_core::variable::acts::{records, Fidelity};
use elevon_core::variable::{Group, Range, Role};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

type Dicts<'py> = PyResult<Bound<'py, PyList>>;

/// A list of dictionaries, one per item.
pub fn dicts<'py, T>(
    py: Python<'py>,
    items: impl IntoIterator<Item = T>,
    fill: impl Fn(&Bound<'py, PyDict>, T) -> PyResult<()>,
) -> Dicts<'py> {
    let list = PyList::empty(py);
    for item in items {
        let dict = PyDict::new(py);
        fill(&dict, item)?;
        list.append(dict)?;
    }
    Ok(list)
}

#[pyfunction]
pub fn version() -> PyResult<&'static str> {
    guarded(|| Ok(env!("CARGO_PKG_VERSION")))
}

#[pyfunction]
pub fn widths(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    guarded(|| {
        let dict = PyDict::new(py);
        let widest = Width::detect();
        for name in Width::NAMES {
            if let Some(width) = Width::by_name(name) {
                dict.set_item(name, width.lanes())?;
            }
        }
        dict.set_item("auto", widest.lanes())?;
        dict.set_item("widest", widest.name())?;
        Ok(dict)
    })
}

#[pyfunction]
pub fn wirings(py: Python<'_>) -> Dicts<'_> {
    guarded(|| {
        dicts(py, KINDS, |d, kind| {
            d.set_item("name", kind.name)?;
            d.set_item("text", kind.text)?;
            let model = kind.fidelities[0].1;
            d.set_item("modes", model.modes().to_vec())?;
            let command = model.ports().iter().find(|p| p.name == "command").map_or("", |p| p.unit);
            let units = PyDict::new(py);
            for (mode, unit) in model.modes().iter().zip(model.mode_units()) {
                units.set_item(mode, if unit.is_empty() { command } else { unit })?;
            }
            d.set_item("mode_units", units)?;
            d.set_item("actions", model.actions().to_vec())?;
            d.set_item("fidelities", kind.fidelities.iter().map(|f| f.0).collect::<Vec<_>>())
        })
    })
}

/// The fidelities that carry something, and why the others decline it.
fn carried(d: &Bound<'_, PyDict>, not_modelled: impl Fn(Fidelity) -> Option<&'static str>) -> PyResult<()> {
    let both = [Fidelity::High, Fidelity::Low];
    let name = |f: &Fidelity| Fidelity::NAMES[*f as usize];
    d.set_item("fidelities", both.iter().filter(|f| not_modelled(**f).is_none()).map(name).collect::<Vec<_>>())?;
    let reasons = PyDict::new(d.py());
    for fidelity in both {
        if let Some(reason) = not_modelled(fidelity) {
            reasons.set_item(name(&fidelity), reason)?;
        }
    }
    d.set_item("not_modelled", reasons)
}

#[pyfunction]
pub fn parameters<'py>(py: Python<'py>, wiring: &str) -> Dicts<'py> {
    guarded(|| {
        dicts(py, records(model(wiring, "high")?.groups()), |d, (path, v)| {
            let (minimum, maximum, open) = v.range.bounds();
            d.set_item("path", path)?;
            d.set_item("symbol", v.symbol)?;
            d.set_item("unit", v.unit)?;
            d.set_item("minimum", minimum)?;
            d.set_item("maximum", maximum)?;
            d.set_item("minimum_open", open)?;
            d.set_item("maximum_open", false)?;
            d.set_item("text", v.text)?;
            d.set_item("register", v.register.name())?;
            d.set_item("whole", matches!(v.range, Range::Count(..)))?;
            d.set_item("default", v.default)?;
            let choices = if let Range::Choice(names) = v.range { Some(names.to_vec()) } else { None };
            d.set_item("choices", choices)?;
            d.set_item("when", v.acts.when.iter().map(ToString::to_string).collect::<Vec<_>>())?;
            carried(d, |fidelity| v.acts.not_modelled(fidelity))
        })
    })
}

#[pyfunction]
pub fn signals<'py>(py: Python<'py>, wiring: &str, fidelity: &str) -> Dicts<'py> {
    guarded(|| {
        dicts(py, model(wiring, fidelity)?.signals(), |d, s| {
            d.set_item("name", s.name)?;
            d.set_item("symbol", s.symbol)?;
            d.set_item("unit", s.unit)?;
            d.set_item("text", s.text)?;
            d.set_item("role", s.role.map(Role::name))
        })
    })
}

/// What signals may be to an actuator, in whose units.
#[pyfunction]
pub fn roles(py: Python<'_>) -> Dicts<'_> {
    guarded(|| {
        dicts(py, Role::ALL, |d, role| {
            d.set_item("name", role.name())?;
            d.set_item("units", role.units().to_vec())?;
            d.set_item("text", role.text())
        })
    })
}

#[pyfunction]
pub fn ports<'py>(py: Python<'py>, wiring: &str) -> Dicts<'py> {
    guarded(|| {
        dicts(py, model(wiring, "high")?.ports(), |d, p| {
            d.set_item("name", p.name)?;
            d.set_item("unit", p.unit)?;
            d.set_item("text", p.text)?;
            d.set_item("parameter", p.parameter)
        })
    })
}

#[pyfunction]
pub fn initial(wiring: &str, fidelity: &str) -> PyResult<Vec<&'static str>> {
    guarded(|| Ok(model(wiring, fidelity)?.initial().to_vec()))
}

/// An attribute ranges over what its parameter does; one without is the period of a pulse.
fn attribute<'py>(d: &Bound<'py, PyDict>, a: &Attribute, groups: &[Group]) -> PyResult<()> {
    let all = groups.iter().flat_map(|g| g.variables.iter().enumerate().map(move |(i, v)| (g.path(i), v.range)));
    let range = all.into_iter().find(|(path, _)| path == a.path).map_or(Range::Positive, |(_, range)| range);
    let (minimum, maximum, open) = range.bounds();
    d.set_item("minimum", minimum)?;
    d.set_item("maximum", maximum)?;
    d.set_item("minimum_open", open)?;
    d.set_item("name", a.name)?;
    d.set_item("unit", a.unit)?;
    d.set_item("default", a.default)?;
    d.set_item("parameter", a.path)?;
    d.set_item("text", a.text)
}

#[pyfunction]
pub fn faults<'py>(py: Python<'py>, wiring: &str) -> Dicts<'py> {
    guarded(|| {
        let model = model(wiring, "high")?;
        dicts(py, model.catalogue(), |d, f| {
            let (minimum, maximum, open) = f.range.bounds();
            d.set_item("kind", f.kind)?;
            d.set_item("places", f.places.iter().map(|p| p.name).collect::<Vec<_>>())?;
            d.set_item("unit", f.unit)?;
            d.set_item("minimum", minimum)?;
            d.set_item("maximum", maximum)?;
            d.set_item("minimum_open", open)?;
            d.set_item("effect", f.effect)?;
            d.set_item("source", f.source)?;
            d.set_item("rate", f.rate.per_hour)?;
            d.set_item("rate_source", f.rate.source)?;
            d.set_item("attributes", dicts(py, f.attributes, |d, a| attribute(d, a, model.groups()))?)?;
            let targets = PyDict::new(py);
            for place in f.places {
                targets.set_item(place.name, place.targets.iter().map(|t| t.path).collect::<Vec<_>>())?;
            }
            d.set_item("targets", targets)?;
            d.set_item("whole", f.counted())?;
            d.set_item("switched", f.switched())?;
            carried(d, |fidelity| f.not_modelled(model.groups(), fidelity))
        })
    })
}

type ParameterRow = (&'static str, &'static str, Option<f64>, &'static str);

fn rows<'py>(py: Python<'py>, parameters: impl IntoIterator<Item = ParameterRow>) -> Dicts<'py> {
    dicts(py, parameters, |d, (name, unit, default, text)| {
        d.set_item("name", name)?;
        d.set_item("unit", unit)?;
        d.set_item("default", default)?;
        d.set_item("text", text)
    })
}

#[pyfunction]
pub fn waveforms(py: Python<'_>) -> Dicts<'_> {
    guarded(|| {
        dicts(py, command::catalogue(), |d, w| {
            d.set_item("kind", w.kind)?;
            d.set_item("text", w.text)?;
            d.set_item("parameters", rows(py, w.parameters.iter().map(|p| (p.name, p.unit, p.default, p.text)))?)
        })
    })
}

/// Values of a waveform at instants; a table has points instead of parameters and is none of these.
#[pyfunction]
pub fn waveform<'py>(
    py: Python<'py>,
    kind: &str,
    parameters: Vec<f64>,
    time: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    guarded(|| {
        let record = command::catalogue().iter().find(|w| w.kind == kind && w.wave != Wave::Table);
        let record = record.ok_or_else(|| bad(format!("no waveform {kind:?} without points")))?;
        if parameters.len() != record.parameters.len() {
            return Err(bad(format!("{kind}: {} parameters given, {} expected", parameters.len(), record.parameters.len())));
        }
        let term = Term { wave: record.wave, enabled: true, parameters, times: [].into(), values: [].into() };
        Ok(PyArray1::from_vec(py, time.as_slice()?.iter().map(|&t| term.at(t)).collect()))
    })
}

/// Derivatives that one pass of `sensitivities` carries.
#[pyfunction]
pub fn derivatives_per_pass() -> PyResult<usize> {
    guarded(|| Ok(derivatives()))
}

#[pyfunction]
pub fn profiles(py: Python<'_>) -> Dicts<'_> {
    guarded(|| {
        dicts(py, fault_profiles(), |d, p| {
            d.set_item("kind", p.kind)?;
            d.set_item("text", p.text)?;
            d.set_item("parameters", rows(py, p.parameters.iter().copied())?)
        })
    })
}

#[pyfunction]
pub fn check<'py>(py: Python<'py>, wiring: &str, fidelity: &str, parameters: PyReadonlyArray1<'py, f64>) -> Dicts<'py> {
    guarded(|| {
        let model = model(wiring, fidelity)?;
        let raw = vector(model, &parameters)?;
        dicts(py, model.check(&raw), |d, f| {
            d.set_item("severity", f.severity.name())?;
            d.set_item("path", f.path)?;
            d.set_item("value", f.value)?;
            d.set_item("limit", f.limit)?;
            d.set_item("message", f.message)
        })
    })
}

/// Why parameters of a run do not act: over all parameters of the wiring, with what its faults move.
#[pyfunction]
#[pyo3(signature = (wiring, fidelity, parameters, faults, paths=None))]
pub fn not_acting<'py>(
    py: Python<'py>,
    wiring: &str,
    fidelity: &str,
    parameters: PyReadonlyArray1<'py, f64>,
    faults: &Bound<'py, PyList>,
    paths: Option<Vec<String>>,
) -> Dicts<'py> {
    guarded(|| {
        let resolver = Resolver::of(wiring, fidelity)?;
        let raw = vector(resolver.model, &parameters)?;
        let faults = resolver.faults(faults)?;
        dicts(py, resolver.model.not_acting(&raw, &faults, paths.as_deref()), |d, (path, reason)| {
            d.set_item("path", path)?;
            d.set_item("reason", reason)
        })
    })
}
