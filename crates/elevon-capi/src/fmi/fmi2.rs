//! FMI 2.0 for co-simulation.

use super::component::{Form, Phase, Status};
use super::instance::{self, folder, missing, on, row, row_mut, text, Instance, Log, Logger, Logger2};
use std::ffi::{c_char, c_int, c_void};

type Handle = *mut c_void;

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub struct Callbacks {
    logger: Option<Logger2>,
    allocate: *const c_void,
    free: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

const CO_SIMULATION: c_int = 1;
const DISCRETE: &[Form] = &[Form::Whole, Form::Choice];
/// `fmi2LastSuccessfulTime`, `fmi2Terminated`.
const LAST_TIME: c_int = 2;
const TERMINATED: c_int = 3;

#[no_mangle]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[no_mangle]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    token: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    _logging: c_int,
) -> Handle {
    // SAFETY: null or the importer's.
    let (logger, environment) = match unsafe { callbacks.as_ref() } {
        Some(given) => (given.logger.map_or(Logger::None, Logger::Two), given.environment),
        None => (Logger::None, std::ptr::null_mut()),
    };
    // SAFETY: as FMI has it.
    let (log, token, address) = unsafe { (Log::new(logger, environment, name), text(token), text(resources)) };
    if kind != CO_SIMULATION {
        log.write(Status::Error, c"this FMU is for co-simulation alone");
        return std::ptr::null_mut();
    }
    Instance::make(log, token, address.and_then(folder))
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2FreeInstance(c: Handle) {
    // SAFETY: as FMI has it.
    unsafe { instance::free(c) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2SetDebugLogging(c: Handle, _on: c_int, _count: usize, _categories: *const *const c_char) -> c_int {
    // SAFETY: as FMI has it. The logger gets errors alone, always.
    unsafe { on(c, |_| Ok(())) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2SetupExperiment(c: Handle, _t: c_int, _tolerance: f64, start: f64, _stops: c_int, _stop: f64) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| x.set_start(start)) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2EnterInitializationMode(c: Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| x.enter_initialisation()) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2ExitInitializationMode(c: Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| x.exit_initialisation()) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2Terminate(c: Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| x.terminate()) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2Reset(c: Handle) -> c_int {
    let work = |x: &mut super::component::Component| {
        x.reset();
        Ok(())
    };
    // SAFETY: as FMI has it.
    unsafe { on(c, work) }
}

/// Getter and setter of a type of numbers.
macro_rules! numbers {
    ($get:ident, $set:ident, $type:ty, $forms:expr, $to:expr, $from:expr) => {
        /// # Safety
        /// As FMI 2.0 has it.
        #[no_mangle]
        pub unsafe extern "C" fn $get(c: Handle, references: *const u32, count: usize, values: *mut $type) -> c_int {
            let work = |x: &mut super::component::Component| {
                // SAFETY: as FMI has it.
                let (Some(references), Some(values)) = (unsafe { (row(references, count), row_mut(values, count)) }) else {
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
        /// As FMI 2.0 has it.
        #[no_mangle]
        pub unsafe extern "C" fn $set(c: Handle, references: *const u32, count: usize, values: *const $type) -> c_int {
            let work = |x: &mut super::component::Component| {
                // SAFETY: as FMI has it.
                let (Some(references), Some(values)) = (unsafe { (row(references, count), row(values, count)) }) else {
                    return missing(x);
                };
                x.set(references, $forms, |i| $from(values[i]))
            };
            // SAFETY: as FMI has it.
            unsafe { on(c, work) }
        }
    };
}

numbers!(fmi2GetReal, fmi2SetReal, f64, &[Form::Real], |x: f64| x, |x: f64| x);
numbers!(fmi2GetInteger, fmi2SetInteger, c_int, DISCRETE, |x: f64| x as c_int, f64::from);
// There are none of these: a call is right only when it asks for nothing.
numbers!(fmi2GetBoolean, fmi2SetBoolean, c_int, &[], |x: f64| x as c_int, f64::from);
numbers!(fmi2GetString, fmi2SetString, *const c_char, &[], |_| std::ptr::null(), |_| 0.0);

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2GetFMUstate(c: Handle, state: *mut Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| instance::get_state(x, state)) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2SetFMUstate(c: Handle, state: Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| instance::set_state(x, state)) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2FreeFMUstate(c: Handle, state: *mut Handle) -> c_int {
    let work = |_: &mut super::component::Component| {
        // SAFETY: as FMI has it.
        unsafe { instance::free_state(state) };
        Ok(())
    };
    // SAFETY: as FMI has it.
    unsafe { on(c, work) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2SerializedFMUstateSize(c: Handle, state: Handle, size: *mut usize) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| instance::state_size(x, state, size)) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2SerializeFMUstate(c: Handle, state: Handle, bytes: *mut u8, size: usize) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| instance::serialise(x, state, bytes, size)) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2DeSerializeFMUstate(c: Handle, bytes: *const u8, size: usize, state: *mut Handle) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| instance::deserialise(x, bytes, size, state)) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2DoStep(c: Handle, time: f64, step: f64, _keep: c_int) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| x.step(time, step)) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2CancelStep(c: Handle) -> c_int {
    // SAFETY: as FMI has it. Steps are done when the call returns.
    unsafe { on(c, |x| x.absent("CancelStep")) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2GetStatus(c: Handle, _kind: c_int, _value: *mut c_int) -> c_int {
    // SAFETY: as FMI has it.
    unsafe { on(c, |x| x.absent("GetStatus")) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2GetRealStatus(c: Handle, kind: c_int, value: *mut f64) -> c_int {
    let work = |x: &mut super::component::Component| {
        x.within(&[Phase::Stepping, Phase::Terminated], "GetRealStatus")?;
        // SAFETY: as FMI has it.
        match unsafe { value.as_mut() } {
            Some(value) if kind == LAST_TIME => {
                *value = x.time();
                Ok(())
            }
            _ => x.absent("GetRealStatus of this kind"),
        }
    };
    // SAFETY: as FMI has it.
    unsafe { on(c, work) }
}

/// # Safety
/// As FMI 2.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi2GetBooleanStatus(c: Handle, kind: c_int, value: *mut c_int) -> c_int {
    let work = |x: &mut super::component::Component| {
        x.within(&[Phase::Stepping, Phase::Terminated], "GetBooleanStatus")?;
        // SAFETY: as FMI has it.
        match unsafe { value.as_mut() } {
            Some(value) if kind == TERMINATED => {
                *value = c_int::from(x.ended);
                Ok(())
            }
            _ => x.absent("GetBooleanStatus of this kind"),
        }
    };
    // SAFETY: as FMI has it.
    unsafe { on(c, work) }
}

/// What this FMU lacks, as its description states.
macro_rules! absent {
    ($($name:ident($($argument:ident: $type:ty),*);)*) => {$(
        /// # Safety
        /// As FMI 2.0 has it.
        #[no_mangle]
        pub unsafe extern "C" fn $name(c: Handle $(, $argument: $type)*) -> c_int {
            // SAFETY: as FMI has it.
            unsafe { on(c, |x| x.absent(stringify!($name))) }
        }
    )*};
}

absent! {
    fmi2GetIntegerStatus(_kind: c_int, _value: *mut c_int);
    fmi2GetStringStatus(_kind: c_int, _value: *mut *const c_char);
    fmi2SetRealInputDerivatives(_references: *const u32, _count: usize, _order: *const c_int, _value: *const f64);
    fmi2GetRealOutputDerivatives(_references: *const u32, _count: usize, _order: *const c_int, _value: *mut f64);
    fmi2GetDirectionalDerivative(_unknown: *const u32, _n: usize, _known: *const u32, _m: usize, _seed: *const f64, _value: *mut f64);
}
