//! What every call across the seam has in common: errors of the package's own family, panics among them.

use elevon_core::panics::{caught, Panicked};
use pyo3::prelude::*;

pyo3::import_exception!(elevon.errors, BusyError);
pyo3::import_exception!(elevon.errors, InputError);
pyo3::import_exception!(elevon.errors, SimulationError);

/// Something that the caller gave is wrong.
pub fn bad(message: impl Into<String>) -> PyErr {
    InputError::new_err(message.into())
}

/// Another thread is at work on the same object.
pub fn busy(message: &'static str) -> PyErr {
    BusyError::new_err(message)
}

/// The work itself failed.
pub fn failed(message: impl Into<String>) -> PyErr {
    SimulationError::new_err(message.into())
}

/// A panic of the core as an error.
pub fn defect(panicked: &Panicked) -> PyErr {
    failed(format!("the core panicked ({}); this is a defect of elevon, please report it", panicked.0))
}

/// Does the work of a call; a panic in it is an error of the family.
pub fn guarded<T>(work: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    caught(work).unwrap_or_else(|panicked| Err(defect(&panicked)))
}
