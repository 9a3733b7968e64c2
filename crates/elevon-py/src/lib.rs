//! The Python seam: converts, releases the GIL, maps errors. No physics, no defaults.

mod describe;
mod features;
mod run;
mod seam;
mod session;
mod spec;

use pyo3::prelude::*;

/// The native core of Elevon.
#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(describe::version, m)?)?;
    m.add_function(wrap_pyfunction!(describe::wirings, m)?)?;
    m.add_function(wrap_pyfunction!(describe::parameters, m)?)?;
    m.add_function(wrap_pyfunction!(describe::signals, m)?)?;
    m.add_function(wrap_pyfunction!(describe::roles, m)?)?;
    m.add_function(wrap_pyfunction!(describe::ports, m)?)?;
    m.add_function(wrap_pyfunction!(describe::initial, m)?)?;
    m.add_function(wrap_pyfunction!(describe::faults, m)?)?;
    m.add_function(wrap_pyfunction!(describe::waveforms, m)?)?;
    m.add_function(wrap_pyfunction!(describe::waveform, m)?)?;
    m.add_function(wrap_pyfunction!(describe::derivatives_per_pass, m)?)?;
    m.add_function(wrap_pyfunction!(describe::profiles, m)?)?;
    m.add_function(wrap_pyfunction!(describe::check, m)?)?;
    m.add_function(wrap_pyfunction!(describe::not_acting, m)?)?;
    m.add_function(wrap_pyfunction!(describe::widths, m)?)?;
    m.add_function(wrap_pyfunction!(features::feature_records, m)?)?;
    m.add_function(wrap_pyfunction!(features::feature_roles, m)?)?;
    m.add_function(wrap_pyfunction!(features::features, m)?)?;
    m.add_function(wrap_pyfunction!(run::simulate, m)?)?;
    m.add_function(wrap_pyfunction!(run::sensitivities, m)?)?;
    m.add_class::<session::Session>()?;
    Ok(())
}
