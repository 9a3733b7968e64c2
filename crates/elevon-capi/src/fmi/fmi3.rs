//! FMI 3.0 for co-simulation.

use super::component::{Component, Form, Phase, Status};
use super::instance::{self, missing, on, row, row_mut, text, Instance, Log, Logger, Logger3};
use std::ffi::{c_char, c_int, c_void};
use std::path::PathBuf;

type Handle = *mut c_void;

#[no_mangle]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    _logging: bool,
    events: bool,
    _early: bool,
    _intermediate: *const u32,
    _count: usize,
    environment: *mut c_void,
    logger: Option<Logger3>,
    _update: *const c_void,
) -> Handle {
    let logger = logger.map_or(Logger::None, Logger::Three);
    // SAFETY: as FMI has it.
    let (log, token, path) = unsafe { (Log::new(logger, environment, name), text(token), text(resources)) };
    if events {
        log.write(Status::Error, c"this FMU has no event mode");
        return std::ptr::null_mut();
    }
    Instance::make(log, token, path.map(PathBuf::from))
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3FreeInstance(c: Handle) {
    // SAFETY: as FMI has it.
    unsafe { instance::free(c) }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3SetDebugLogging(c: Handle, _on: bool, _count: usize, _categories: *const *const c_char) -> c_int {
    // SAFETY: as FMI has it. The logger gets errors alone, always.
    unsafe { on(c, |_| Ok(())) }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3EnterInitializationMode(c: Handle, _t: bool, _tolerance: f64, start: f64, _stops: bool, _stop: f64) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| x.set_start(start).and_then(|()| x.enter_initialisation())) }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3ExitInitializationMode(c: Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, Component::exit_initialisation) }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3Terminate(c: Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, Component::terminate) }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3Reset(c: Handle) -> c_int {
    let work = |x: &mut Component| {
        x.reset();
        Ok(())
    };
    // SAFETY: as FMI has it.
    unsafe { on(c, work) }
}

/// Getter and setter of a type of numbers; as many values as variables, for there are no arrays.
macro_rules! numbers {
    ($get:ident, $set:ident, $type:ty, $forms:expr, $to:expr, $from:expr) => {
        /// # Safety
        /// As FMI 3.0 has it.
        #[no_mangle]
        pub unsafe extern "C" fn $get(c: Handle, references: *const u32, count: usize, values: *mut $type, n: usize) -> c_int {
            let work = |x: &mut super::component::Component| {
                // SAFETY: as FMI has it.
                let (Some(references), Some(values), true) = (unsafe { (row(references, count), row_mut(values, n), n == count) }) else {
                    return missing(x);
                };
                for (&reference, value) in references.iter().zip(values) {
                    *value = $to(x.get(reference, $forms)?);
                }
                Ok(())
            };
            // SAFETY: as FMI has it.
            unsafe { on(c, work) }
        }

        /// # Safety
        /// As FMI 3.0 has it.
        #[no_mangle]
        pub unsafe extern "C" fn $set(c: Handle, references: *const u32, count: usize, values: *const $type, n: usize) -> c_int {
            let work = |x: &mut super::component::Component| {
                // SAFETY: as FMI has it.
                let (Some(references), Some(values), true) = (unsafe { (row(references, count), row(values, n), n == count) }) else {
                    return missing(x);
                };
                x.set(references, $forms, |i| $from(values[i]))
            };
            // SAFETY: as FMI has it.
            unsafe { on(c, work) }
        }
    };
}
pub(super) use numbers;

numbers!(fmi3GetFloat64, fmi3SetFloat64, f64, &[Form::Real], |x: f64| x, |x: f64| x);
numbers!(fmi3GetInt32, fmi3SetInt32, i32, &[Form::Whole], |x: f64| x as i32, f64::from);
numbers!(fmi3GetInt64, fmi3SetInt64, i64, &[Form::Choice], |x: f64| x as i64, |x: i64| x as f64);

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3GetFMUState(c: Handle, state: *mut Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| instance::get_state(x, state)) }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3SetFMUState(c: Handle, state: Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| instance::set_state(x, state)) }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3FreeFMUState(c: Handle, state: *mut Handle) -> c_int {
    let work = |_: &mut Component| {
        // SAFETY: as FMI has it.
        unsafe { instance::free_state(state) };
        Ok(())
    };
    // SAFETY: as FMI has it.
    unsafe { on(c, work) }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3SerializedFMUStateSize(c: Handle, state: Handle, size: *mut usize) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| instance::state_size(x, state, size)) }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3SerializeFMUState(c: Handle, state: Handle, bytes: *mut u8, size: usize) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| instance::serialise(x, state, bytes, size)) }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3DeserializeFMUState(c: Handle, bytes: *const u8, size: usize, state: *mut Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| instance::deserialise(x, bytes, size, state)) }
}

/// What a step tells besides its status.
struct StepOutcome {
    event: *mut bool,
    terminate: *mut bool,
    early: *mut bool,
    time: *mut f64,
}

impl StepOutcome {
    /// # Safety
    /// Null or valid, each.
    unsafe fn write(&self, x: &Component) {
        // SAFETY: null or valid.
        unsafe {
            for (flag, value) in [(self.event, false), (self.terminate, x.ended), (self.early, false)] {
                if let Some(flag) = flag.as_mut() {
                    *flag = value;
                }
            }
            if let Some(time) = self.time.as_mut() {
                *time = x.time();
            }
        }
    }
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3DoStep(
    c: Handle,
    time: f64,
    step: f64,
    _keep: bool,
    event: *mut bool,
    terminate: *mut bool,
    early: *mut bool,
    last: *mut f64,
) -> c_int {
    let outcome = StepOutcome { event, terminate, early, time: last };
    let work = |x: &mut Component| {
        let begun = x.phase == Phase::Stepping && !x.ended;
        let done = x.step(time, step);
        // SAFETY: as FMI has it.
        unsafe { outcome.write(x) };
        // A run that comes to its end within the step has done what it could.
        if begun && x.ended && done == Err(Status::Discard) {
            return Err(Status::Warning);
        }
        done
    };
    // SAFETY: as FMI has it.
    unsafe { on(c, work) }
}
