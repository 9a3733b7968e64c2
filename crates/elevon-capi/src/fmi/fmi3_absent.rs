//! What of FMI 3.0 this FMU does not have: other kinds of simulation, other types, clocks, events, derivatives. The
//! functions must be there.

use super::fmi3::numbers;
use super::instance::{missing, on, row, row_mut};
use std::ffi::{c_char, c_int, c_void};

type Handle = *mut c_void;

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3InstantiateModelExchange(
    _name: *const c_char,
    _token: *const c_char,
    _resources: *const c_char,
    _visible: bool,
    _logging: bool,
    _environment: *mut c_void,
    _logger: *const c_void,
) -> Handle {
    std::ptr::null_mut()
}

/// # Safety
/// As FMI 3.0 has it.
#[no_mangle]
pub unsafe extern "C" fn fmi3InstantiateScheduledExecution(
    _name: *const c_char,
    _token: *const c_char,
    _resources: *const c_char,
    _visible: bool,
    _logging: bool,
    _environment: *mut c_void,
    _logger: *const c_void,
    _update: *const c_void,
    _lock: *const c_void,
    _unlock: *const c_void,
) -> Handle {
    std::ptr::null_mut()
}

// There are no variables of these types: a call is right only when it asks for nothing.
numbers!(fmi3GetFloat32, fmi3SetFloat32, f32, &[], |x: f64| x as f32, f64::from);
numbers!(fmi3GetInt8, fmi3SetInt8, i8, &[], |x: f64| x as i8, f64::from);
numbers!(fmi3GetUInt8, fmi3SetUInt8, u8, &[], |x: f64| x as u8, f64::from);
numbers!(fmi3GetInt16, fmi3SetInt16, i16, &[], |x: f64| x as i16, f64::from);
numbers!(fmi3GetUInt16, fmi3SetUInt16, u16, &[], |x: f64| x as u16, f64::from);
numbers!(fmi3GetUInt32, fmi3SetUInt32, u32, &[], |x: f64| x as u32, f64::from);
numbers!(fmi3GetUInt64, fmi3SetUInt64, u64, &[], |x: f64| x as u64, |x: u64| x as f64);
numbers!(fmi3GetBoolean, fmi3SetBoolean, u8, &[], |x: f64| x as u8, f64::from);
numbers!(fmi3GetString, fmi3SetString, *const c_char, &[], |_| std::ptr::null(), |_| 0.0);

/// Functions that this FMU answers with an error.
macro_rules! absent {
    ($($name:ident($($type:ty),*);)*) => {$(
        absent!(@ $name, [$($type),*], [a b d e f g h i]);
    )*};
    (@ $name:ident, [$($type:ty),*], [$($all:ident)*]) => {
        absent!(@@ $name, [$($type),*], [$($all)*], []);
    };
    (@@ $name:ident, [$type:ty $(, $rest:ty)*], [$argument:ident $($all:ident)*], [$($done:tt)*]) => {
        absent!(@@ $name, [$($rest),*], [$($all)*], [$($done)* , $argument: $type]);
    };
    (@@ $name:ident, [], [$($all:ident)*], [$($done:tt)*]) => {
        /// # Safety
        /// As FMI 3.0 has it.
        #[no_mangle]
        #[allow(unused_variables)]
        pub unsafe extern "C" fn $name(c: Handle $($done)*) -> c_int {
            // SAFETY: as FMI has it.
            unsafe { on(c, |x| x.absent(stringify!($name))) }
        }
    };
}

absent! {
    fmi3GetBinary(*const u32, usize, *mut usize, *mut *const u8, usize);
    fmi3SetBinary(*const u32, usize, *const usize, *const *const u8, usize);
    fmi3GetClock(*const u32, usize, *mut bool);
    fmi3SetClock(*const u32, usize, *const bool);
    fmi3GetNumberOfVariableDependencies(u32, *mut usize);
    fmi3GetVariableDependencies(u32, *mut usize, *mut u32, *mut usize, *mut c_int, usize);
    fmi3GetDirectionalDerivative(*const u32, usize, *const u32, usize, *const f64, usize, *mut f64, usize);
    fmi3GetAdjointDerivative(*const u32, usize, *const u32, usize, *const f64, usize, *mut f64, usize);
    fmi3EnterConfigurationMode();
    fmi3ExitConfigurationMode();
    fmi3EnterEventMode();
    fmi3GetIntervalDecimal(*const u32, usize, *mut f64, *mut c_int);
    fmi3GetIntervalFraction(*const u32, usize, *mut u64, *mut u64, *mut c_int);
    fmi3GetShiftDecimal(*const u32, usize, *mut f64);
    fmi3GetShiftFraction(*const u32, usize, *mut u64, *mut u64);
    fmi3SetIntervalDecimal(*const u32, usize, *const f64);
    fmi3SetIntervalFraction(*const u32, usize, *const u64, *const u64);
    fmi3SetShiftDecimal(*const u32, usize, *const f64);
    fmi3SetShiftFraction(*const u32, usize, *const u64, *const u64);
    fmi3EvaluateDiscreteStates();
    fmi3UpdateDiscreteStates(*mut bool, *mut bool, *mut bool, *mut bool, *mut bool, *mut f64);
    fmi3EnterContinuousTimeMode();
    fmi3CompletedIntegratorStep(bool, *mut bool, *mut bool);
    fmi3SetTime(f64);
    fmi3SetContinuousStates(*const f64, usize);
    fmi3GetContinuousStateDerivatives(*mut f64, usize);
    fmi3GetEventIndicators(*mut f64, usize);
    fmi3GetContinuousStates(*mut f64, usize);
    fmi3GetNominalsOfContinuousStates(*mut f64, usize);
    fmi3GetNumberOfEventIndicators(*mut usize);
    fmi3GetNumberOfContinuousStates(*mut usize);
    fmi3EnterStepMode();
    fmi3GetOutputDerivatives(*const u32, usize, *const i32, *mut f64, usize);
    fmi3ActivateModelPartition(u32, f64);
}
