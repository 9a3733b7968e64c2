//! The C interface. `include/elevon.h` is made from this file.

use crate::run::{Fault, Run, Verdict};
use crate::spec::Spec;
use elevon_core::panics::caught;
use std::ffi::{c_char, c_int, CStr};
use std::sync::atomic::{AtomicBool, Ordering};

/// Done.
pub const ELEVON_OK: c_int = 0;
/// Done; the drive has tripped, or its control unit has given up.
pub const ELEVON_TRIPPED: c_int = 1;
/// Done; the winding has passed its limit, and the run stands.
pub const ELEVON_OVERHEATED: c_int = 2;
/// A null pointer, an index that does not exist, a number that is none, too little room.
pub const ELEVON_ARGUMENT: c_int = -1;
/// A value outside its range, alone or with the others.
pub const ELEVON_RANGE: c_int = -2;
/// A time that is no whole number of solver steps.
pub const ELEVON_STEP: c_int = -3;
/// The run has left the finite numbers, and stands.
pub const ELEVON_ENDED: c_int = -4;
/// No state of a run made from the same document, or a damaged one.
pub const ELEVON_STATE: c_int = -5;
/// The document cannot be run.
pub const ELEVON_DOCUMENT: c_int = -6;
/// Another thread is at work on the run.
pub const ELEVON_BUSY: c_int = -7;
/// A defect of Elevon: the run is lost.
pub const ELEVON_DEFECT: c_int = -8;

/// A run. One thread at a time; several runs are independent of each other.
pub struct ElevonRun {
    busy: AtomicBool,
    lost: bool,
    run: Run,
    inputs: Vec<String>,
    outputs: Vec<String>,
    faults: Vec<String>,
}

fn code(fault: Fault) -> c_int {
    match fault {
        Fault::Argument => ELEVON_ARGUMENT,
        Fault::Range => ELEVON_RANGE,
        Fault::Step => ELEVON_STEP,
        Fault::Ended => ELEVON_ENDED,
        Fault::State => ELEVON_STATE,
    }
}

fn outcome(result: Result<Verdict, Fault>) -> c_int {
    match result {
        Ok(Verdict::Ok) => ELEVON_OK,
        Ok(Verdict::Tripped) => ELEVON_TRIPPED,
        Ok(Verdict::Overheated) => ELEVON_OVERHEATED,
        Err(fault) => code(fault),
    }
}

/// Does the work of a call, alone on its run; a panic in it loses the run, not the process.
///
/// # Safety
/// `run` is null or of `elevon_create`, and not freed.
unsafe fn on(run: *mut ElevonRun, work: impl FnOnce(&mut ElevonRun) -> c_int) -> c_int {
    if run.is_null() {
        return ELEVON_ARGUMENT;
    }
    // SAFETY: the pointer is of `elevon_create`; only the atomic is looked at before the run is taken.
    let busy = unsafe { &*std::ptr::addr_of!((*run).busy) };
    if busy.swap(true, Ordering::Acquire) {
        return ELEVON_BUSY;
    }
    // SAFETY: whoever has set `busy` has the run to itself.
    let handle = unsafe { &mut *run };
    let done = if handle.lost { ELEVON_DEFECT } else { caught(|| work(handle)).unwrap_or(ELEVON_DEFECT) };
    // SAFETY: as above; the work's borrow has ended.
    let handle = unsafe { &mut *run };
    handle.lost |= done == ELEVON_DEFECT;
    handle.busy.store(false, Ordering::Release);
    done
}

/// A text of the caller's.
///
/// # Safety
/// `text` is null or ends with a zero.
unsafe fn given<'a>(text: *const c_char) -> Option<&'a str> {
    if text.is_null() {
        return None;
    }
    // SAFETY: not null, and it ends with a zero.
    unsafe { CStr::from_ptr(text) }.to_str().ok()
}

/// As much of a text as there is room for, with its zero.
///
/// # Safety
/// `to` is null or has `room` bytes.
unsafe fn write_text(text: &str, to: *mut c_char, room: usize) {
    if to.is_null() || room == 0 {
        return;
    }
    let length = text.len().min(room - 1);
    // SAFETY: there are `room` bytes, more than `length`.
    unsafe {
        std::ptr::copy_nonoverlapping(text.as_ptr().cast(), to, length);
        *to.add(length) = 0;
    }
}

fn made(document: &str) -> Result<Box<ElevonRun>, String> {
    let spec = Spec::read(document)?;
    let run = Run::new(&spec)?;
    let signals = spec.model.signals();
    Ok(Box::new(ElevonRun {
        busy: AtomicBool::new(false),
        lost: false,
        run,
        inputs: spec.model.ports().iter().map(|p| p.name.to_string()).collect(),
        outputs: spec.outputs.iter().map(|&s| signals[s].name.to_string()).collect(),
        faults: spec.faults.iter().map(|f| format!("{}@{}", f.kind, f.place)).collect(),
    }))
}

/// Makes a run from a document that `elevon export run` wrote (a text that ends with a zero). It takes all its memory here.
/// On failure `message` (of `room` bytes, or null) has the reason.
///
/// # Safety
/// The pointers are null or valid.
#[no_mangle]
pub unsafe extern "C" fn elevon_create(document: *const c_char, run: *mut *mut ElevonRun, message: *mut c_char, room: usize) -> c_int {
    // SAFETY: as the caller promises.
    let text = unsafe { given(document) };
    let (Some(text), false) = (text, run.is_null()) else {
        return ELEVON_ARGUMENT;
    };
    let result = caught(|| made(text)).unwrap_or_else(|panicked| Err(format!("a defect of elevon: {}", panicked.0)));
    match result {
        Ok(handle) => {
            // SAFETY: not null, and the caller's.
            unsafe { *run = Box::into_raw(handle) };
            ELEVON_OK
        }
        Err(reason) => {
            // SAFETY: as the caller promises.
            unsafe {
                *run = std::ptr::null_mut();
                write_text(&reason, message, room);
            }
            ELEVON_DOCUMENT
        }
    }
}

/// Frees a run; null is none.
///
/// # Safety
/// `run` is null or of `elevon_create`, not freed, and no other call is at work on it.
#[no_mangle]
pub unsafe extern "C" fn elevon_free(run: *mut ElevonRun) {
    if !run.is_null() {
        // SAFETY: of `Box::into_raw`, and no longer used.
        drop(unsafe { Box::from_raw(run) });
    }
}

/// Steps on by a whole number of solver steps, in s.
///
/// # Safety
/// As `elevon_free`, of a run that goes on.
#[no_mangle]
pub unsafe extern "C" fn elevon_step(run: *mut ElevonRun, seconds: f64) -> c_int {
    // SAFETY: as the caller promises.
    unsafe { on(run, |handle| outcome(handle.run.advance(seconds))) }
}

/// Holds an input at a value (SI) from now on.
///
/// # Safety
/// As `elevon_step`.
#[no_mangle]
pub unsafe extern "C" fn elevon_set_input(run: *mut ElevonRun, index: usize, value: f64) -> c_int {
    let work = |handle: &mut ElevonRun| match index < handle.inputs.len() {
        true => handle.run.set_input(index, value).map_or_else(code, |()| ELEVON_OK),
        false => ELEVON_ARGUMENT,
    };
    // SAFETY: as the caller promises.
    unsafe { on(run, work) }
}

/// Gives a fault a severity (SI) from now on; 0 is healthy.
///
/// # Safety
/// As `elevon_step`.
#[no_mangle]
pub unsafe extern "C" fn elevon_set_fault(run: *mut ElevonRun, index: usize, severity: f64) -> c_int {
    let work = |handle: &mut ElevonRun| match index < handle.faults.len() {
        true => handle.run.set_severities(std::iter::once((index, severity))).map_or_else(code, |()| ELEVON_OK),
        false => ELEVON_ARGUMENT,
    };
    // SAFETY: as the caller promises.
    unsafe { on(run, work) }
}

/// Reads all outputs (SI), in their order, into `count` numbers.
///
/// # Safety
/// As `elevon_step`; `values` has room for `count` numbers.
#[no_mangle]
pub unsafe extern "C" fn elevon_read(run: *mut ElevonRun, values: *mut f64, count: usize) -> c_int {
    let work = |handle: &mut ElevonRun| {
        if values.is_null() || count != handle.outputs.len() {
            return ELEVON_ARGUMENT;
        }
        // SAFETY: not null, with room for them.
        handle.run.read(unsafe { std::slice::from_raw_parts_mut(values, count) });
        ELEVON_OK
    };
    // SAFETY: as the caller promises.
    unsafe { on(run, work) }
}

/// Writes time and solver step (s), and how many inputs, outputs and faults there are; pointers may be null.
///
/// # Safety
/// As `elevon_step`; the pointers are null or valid.
#[no_mangle]
pub unsafe extern "C" fn elevon_describe(
    run: *mut ElevonRun,
    time: *mut f64,
    solver_step: *mut f64,
    inputs: *mut usize,
    outputs: *mut usize,
    faults: *mut usize,
) -> c_int {
    let work = |handle: &mut ElevonRun| {
        for (to, value) in [(time, handle.run.time()), (solver_step, handle.run.dt())] {
            if !to.is_null() {
                // SAFETY: not null, and the caller's.
                unsafe { *to = value };
            }
        }
        for (to, value) in [(inputs, handle.inputs.len()), (outputs, handle.outputs.len()), (faults, handle.faults.len())] {
            if !to.is_null() {
                // SAFETY: not null, and the caller's.
                unsafe { *to = value };
            }
        }
        ELEVON_OK
    };
    // SAFETY: as the caller promises.
    unsafe { on(run, work) }
}

/// Finds an input (`command`), an output (`output_position`) or a fault (`short@motor.phase_a`): `what` is 0, 1 or 2.
///
/// # Safety
/// As `elevon_step`; `name` ends with a zero, `index` is valid.
#[no_mangle]
pub unsafe extern "C" fn elevon_find(run: *mut ElevonRun, what: c_int, name: *const c_char, index: *mut usize) -> c_int {
    // SAFETY: as the caller promises.
    let name = unsafe { given(name) };
    let work = |handle: &mut ElevonRun| {
        let names = match what {
            0 => &handle.inputs,
            1 => &handle.outputs,
            2 => &handle.faults,
            _ => return ELEVON_ARGUMENT,
        };
        match names.iter().position(|other| Some(other.as_str()) == name) {
            Some(found) if !index.is_null() => {
                // SAFETY: not null, and the caller's.
                unsafe { *index = found };
                ELEVON_OK
            }
            _ => ELEVON_ARGUMENT,
        }
    };
    // SAFETY: as the caller promises.
    unsafe { on(run, work) }
}

/// Writes the bytes that a state of the run takes.
///
/// # Safety
/// As `elevon_step`; `size` is valid.
#[no_mangle]
pub unsafe extern "C" fn elevon_state_size(run: *mut ElevonRun, size: *mut usize) -> c_int {
    let work = |handle: &mut ElevonRun| {
        if size.is_null() {
            return ELEVON_ARGUMENT;
        }
        // SAFETY: not null, and the caller's.
        unsafe { *size = handle.run.state_size() };
        ELEVON_OK
    };
    // SAFETY: as the caller promises.
    unsafe { on(run, work) }
}

/// Writes the state into memory of `size` bytes.
///
/// # Safety
/// As `elevon_step`; `bytes` has `size` bytes.
#[no_mangle]
pub unsafe extern "C" fn elevon_save(run: *mut ElevonRun, bytes: *mut u8, size: usize) -> c_int {
    let work = |handle: &mut ElevonRun| {
        if bytes.is_null() {
            return ELEVON_ARGUMENT;
        }
        // SAFETY: not null, with `size` bytes.
        handle.run.save(unsafe { std::slice::from_raw_parts_mut(bytes, size) }).map_or_else(code, |_| ELEVON_OK)
    };
    // SAFETY: as the caller promises.
    unsafe { on(run, work) }
}

/// Goes back, or forth, to a state that this run or one made from the same document wrote.
///
/// # Safety
/// As `elevon_step`; `bytes` has `size` bytes.
#[no_mangle]
pub unsafe extern "C" fn elevon_restore(run: *mut ElevonRun, bytes: *const u8, size: usize) -> c_int {
    let work = |handle: &mut ElevonRun| {
        if bytes.is_null() {
            return ELEVON_ARGUMENT;
        }
        // SAFETY: not null, with `size` bytes.
        handle.run.restore(unsafe { std::slice::from_raw_parts(bytes, size) }).map_or_else(code, |()| ELEVON_OK)
    };
    // SAFETY: as the caller promises.
    unsafe { on(run, work) }
}

/// The text of the last error of a run; it stays until the next one.
///
/// # Safety
/// As `elevon_step`.
#[no_mangle]
pub unsafe extern "C" fn elevon_message(run: *const ElevonRun) -> *const c_char {
    if run.is_null() {
        return c"no run".as_ptr();
    }
    // SAFETY: of `elevon_create`; the text has its place in the run.
    unsafe { &*std::ptr::addr_of!((*run).run.text) }.as_ptr()
}

/// What a code means.
#[no_mangle]
pub extern "C" fn elevon_code_text(code: c_int) -> *const c_char {
    let text = match code {
        ELEVON_OK => c"done",
        ELEVON_TRIPPED => c"done; the drive has tripped",
        ELEVON_OVERHEATED => c"done; the winding has passed its limit, the run stands",
        ELEVON_ARGUMENT => c"an argument that cannot be",
        ELEVON_RANGE => c"a value outside its range",
        ELEVON_STEP => c"a time that is no whole number of solver steps",
        ELEVON_ENDED => c"the run has left the finite numbers",
        ELEVON_STATE => c"no state of a run made from the same document",
        ELEVON_DOCUMENT => c"the document cannot be run",
        ELEVON_BUSY => c"another thread is at work on the run",
        ELEVON_DEFECT => c"a defect of elevon: the run is lost",
        _ => c"no such code",
    };
    text.as_ptr()
}

/// The version of Elevon.
#[no_mangle]
pub extern "C" fn elevon_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}
