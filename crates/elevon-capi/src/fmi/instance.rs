//! What an FMI call is given: an instance, alone; texts, rows of numbers; and the logger that gets what went wrong.

use super::component::{Component, Done, Status};
use crate::spec::Spec;
use elevon_core::panics::caught;
use std::cell::UnsafeCell;
use std::ffi::{c_char, c_int, c_void, CStr, CString};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// `fmi2CallbackLogger`.
pub type Logger2 = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);
/// `fmi3LogMessageCallback`.
pub type Logger3 = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

#[derive(Clone, Copy)]
pub enum Logger {
    None,
    Two(Logger2),
    Three(Logger3),
}

/// Where errors go, and under which name.
pub struct Log {
    logger: Logger,
    environment: *mut c_void,
    name: CString,
}

impl Log {
    /// # Safety
    /// The logger bears the environment; `name` is null or ends with a zero.
    pub unsafe fn new(logger: Logger, environment: *mut c_void, name: *const c_char) -> Self {
        // SAFETY: not null, and it ends with a zero.
        let name = if name.is_null() { CString::default() } else { unsafe { CStr::from_ptr(name) }.to_owned() };
        Self { logger, environment, name }
    }

    pub fn write(&self, status: Status, text: &CStr) {
        let category = match status {
            Status::Ok | Status::Warning => c"logStatusWarning",
            Status::Discard => c"logStatusDiscard",
            Status::Error => c"logStatusError",
            Status::Fatal => c"logStatusFatal",
        };
        // A logger of FMI 2.0 reads its text as a format.
        let plain = if text.to_bytes().contains(&b'%') { c"(a text with a percent sign)" } else { text };
        // SAFETY: the logger is the importer's, called as its version has it.
        unsafe {
            match self.logger {
                Logger::None => {}
                Logger::Two(call) => call(self.environment, self.name.as_ptr(), status as c_int, category.as_ptr(), plain.as_ptr()),
                Logger::Three(call) => call(self.environment, status as c_int, category.as_ptr(), text.as_ptr()),
            }
        }
    }
}

/// What `fmi2Component` and `fmi3Instance` point to.
pub struct Instance {
    busy: AtomicBool,
    log: Log,
    component: UnsafeCell<Component>,
}

/// What `fmi2FMUstate` and `fmi3FMUState` point to.
pub struct State(pub Vec<u8>);

impl Instance {
    /// An instance of the FMU whose resources lie in a folder; null, with a line to the logger, where there is none.
    pub fn make(log: Log, token: Option<&str>, resources: Option<PathBuf>) -> *mut c_void {
        let made = caught(|| read(token, resources)).unwrap_or_else(|panicked| Err(format!("a defect of elevon: {}", panicked.0)));
        match made {
            Ok(spec) => {
                let component = UnsafeCell::new(Component::new(spec));
                Box::into_raw(Box::new(Self { busy: AtomicBool::new(false), log, component })).cast()
            }
            Err(reason) => {
                log.write(Status::Error, &CString::new(reason).unwrap_or_default());
                std::ptr::null_mut()
            }
        }
    }
}

/// The document of the FMU.
fn read(token: Option<&str>, resources: Option<PathBuf>) -> Result<Spec, String> {
    let folder = resources.ok_or("the path of the resources is none that can be read")?;
    let path = folder.join("elevon.json");
    let bytes = std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let text = String::from_utf8(bytes).map_err(|_| format!("{}: not UTF-8", path.display()))?;
    let spec = Spec::read(&text).map_err(|reason| format!("{}: {reason}", path.display()))?;
    spec.resolved().map_err(|reason| format!("{}: {reason}", path.display()))?;
    if token != Some(&spec.token) {
        return Err("the instantiation token is not that of the FMU".to_string());
    }
    Ok(spec)
}

/// Does the work of a call, alone on its instance; what went wrong goes to the logger. A panic is fatal to the instance, not to the process.
///
/// # Safety
/// `instance` is null or of `Instance::make`, and not freed.
pub unsafe fn on(instance: *mut c_void, work: impl FnOnce(&mut Component) -> Done) -> c_int {
    let shared: *mut Instance = instance.cast();
    if shared.is_null() {
        return Status::Error as c_int;
    }
    // SAFETY: of `Instance::make`; what is shared is an atomic and the log.
    let shared = unsafe { &*shared };
    if shared.busy.swap(true, Ordering::Acquire) {
        shared.log.write(Status::Error, c"another thread is at work on the instance; it bears one at a time");
        return Status::Error as c_int;
    }
    // SAFETY: whoever has set `busy` has the component to itself.
    let component = unsafe { &mut *shared.component.get() };
    let status = match caught(|| work(component)) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(status)) => status,
        Err(panicked) => {
            component.text.set(format_args!("a defect of elevon: {}", panicked.0));
            component.phase = super::component::Phase::Terminated;
            Status::Fatal
        }
    };
    if status != Status::Ok {
        shared.log.write(status, component.text.as_c());
    }
    shared.busy.store(false, Ordering::Release);
    status as c_int
}

/// # Safety
/// `instance` is null or of `Instance::make`, not freed, and no call is at work on it.
pub unsafe fn free(instance: *mut c_void) {
    if !instance.is_null() {
        // SAFETY: of `Box::into_raw`, and no longer used.
        drop(unsafe { Box::from_raw(instance.cast::<Instance>()) });
    }
}

/// A row of the caller's to read; none where it is null though it should hold something.
///
/// # Safety
/// `row` is null or has `count` items.
pub unsafe fn row<'a, T>(row: *const T, count: usize) -> Option<&'a [T]> {
    match (row.is_null(), count) {
        (_, 0) => Some(&[]),
        (true, _) => None,
        // SAFETY: not null, with so many items.
        _ => Some(unsafe { std::slice::from_raw_parts(row, count) }),
    }
}

/// The same to write to.
///
/// # Safety
/// As `row`.
pub unsafe fn row_mut<'a, T>(row: *mut T, count: usize) -> Option<&'a mut [T]> {
    match (row.is_null(), count) {
        (_, 0) => Some(&mut []),
        (true, _) => None,
        // SAFETY: not null, with so many items.
        _ => Some(unsafe { std::slice::from_raw_parts_mut(row, count) }),
    }
}

/// What a missing argument is.
pub fn missing<T>(component: &mut Component) -> Done<T> {
    component.text.set(format_args!("a null pointer where something was expected"));
    Err(Status::Error)
}

/// A text of the caller's.
///
/// # Safety
/// Null, or it ends with a zero.
pub unsafe fn text<'a>(text: *const c_char) -> Option<&'a str> {
    if text.is_null() {
        return None;
    }
    // SAFETY: not null, and it ends with a zero.
    unsafe { CStr::from_ptr(text) }.to_str().ok()
}

/// The folder of a `file:` address, with its escapes decoded.
pub fn folder(address: &str) -> Option<PathBuf> {
    let rest = address.strip_prefix("file:")?;
    let path = rest.strip_prefix("//").map_or(rest, |path| path.strip_prefix("localhost").unwrap_or(path));
    // file:///C:/x is C:/x.
    let drive = path.as_bytes().get(2) == Some(&b':');
    let path = if drive { &path[1..] } else { path };
    let (bytes, mut out, mut at) = (path.as_bytes(), Vec::new(), 0);
    while at < bytes.len() {
        if bytes[at] == b'%' {
            let code = path.get(at + 1..at + 3)?;
            out.push(u8::from_str_radix(code, 16).ok()?);
            at += 3;
        } else {
            out.push(bytes[at]);
            at += 1;
        }
    }
    String::from_utf8(out).ok().map(PathBuf::from)
}

/// Writes the component's state where it is asked for: into that which is there, or a new one.
///
/// # Safety
/// `state` is valid, and points to null or to a state of this library.
pub unsafe fn get_state(component: &mut Component, state: *mut *mut c_void) -> Done {
    if state.is_null() {
        return missing(component);
    }
    let bytes = component.save()?;
    // SAFETY: not null; what it points to is null or ours.
    unsafe {
        match (*state).cast::<State>().as_mut() {
            Some(there) => there.0 = bytes,
            None => *state = Box::into_raw(Box::new(State(bytes))).cast(),
        }
    }
    Ok(())
}

/// # Safety
/// `state` is null or of this library.
pub unsafe fn set_state(component: &mut Component, state: *mut c_void) -> Done {
    // SAFETY: as the caller promises.
    match unsafe { state.cast::<State>().as_ref() } {
        Some(there) => component.restore(&there.0),
        None => missing(component),
    }
}

/// # Safety
/// `state` is valid, and points to null or to a state of this library that no call uses.
pub unsafe fn free_state(state: *mut *mut c_void) {
    // SAFETY: as the caller promises.
    unsafe {
        if !state.is_null() && !(*state).is_null() {
            drop(Box::from_raw((*state).cast::<State>()));
            *state = std::ptr::null_mut();
        }
    }
}

/// # Safety
/// `state` is null or of this library; `size` is null or valid.
pub unsafe fn state_size(component: &mut Component, state: *mut c_void, size: *mut usize) -> Done {
    // SAFETY: as the caller promises.
    match unsafe { (state.cast::<State>().as_ref(), size.as_mut()) } {
        (Some(there), Some(size)) => {
            *size = there.0.len();
            Ok(())
        }
        _ => missing(component),
    }
}

/// # Safety
/// `state` is null or of this library; `bytes` has `size` bytes.
pub unsafe fn serialise(component: &mut Component, state: *mut c_void, bytes: *mut u8, size: usize) -> Done {
    // SAFETY: as the caller promises.
    match unsafe { (state.cast::<State>().as_ref(), row_mut(bytes, size)) } {
        (Some(there), Some(to)) if to.len() >= there.0.len() => {
            to[..there.0.len()].copy_from_slice(&there.0);
            Ok(())
        }
        _ => missing(component),
    }
}

/// # Safety
/// `bytes` has `size` bytes; `state` is valid, and points to null or to a state of this library.
pub unsafe fn deserialise(component: &mut Component, bytes: *const u8, size: usize, state: *mut *mut c_void) -> Done {
    // SAFETY: as the caller promises.
    let Some(from) = (unsafe { row(bytes, size) }).filter(|_| !state.is_null()) else {
        return missing(component);
    };
    component.check_state(from)?;
    // SAFETY: as the caller promises.
    unsafe {
        match (*state).cast::<State>().as_mut() {
            Some(there) => there.0 = from.to_vec(),
            None => *state = Box::into_raw(Box::new(State(from.to_vec()))).cast(),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::folder;
    use std::path::PathBuf;

    #[test]
    fn addresses_are_folders() {
        for (address, path) in [
            ("file:///tmp/a%20b", Some("/tmp/a b")),
            ("file:/tmp/x", Some("/tmp/x")),
            ("file://localhost/tmp", Some("/tmp")),
            ("file:///C:/x", Some("C:/x")),
            ("http://a/b", None),
            ("file:///%zz", None),
            ("file:///%4", None),
        ] {
            assert_eq!(folder(address), path.map(PathBuf::from), "{address}");
        }
    }
}
