//! Panics as errors: a defect of the core must not take its caller's process with it.

use std::any::Any;
use std::panic::{catch_unwind, AssertUnwindSafe};

/// The work panicked, with its message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Panicked(pub String);

/// Does `work`; a panic in it is an error. What the work changes must not be read after one.
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, Panicked> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| Panicked(message(&*payload)))
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_with_its_message() {
        assert_eq!(caught(|| 3), Ok(3));
        let place: Vec<u8> = Vec::new();
        let outside = caught(|| place[std::hint::black_box(2)]).map_err(|panicked| panicked.0);
        assert!(outside.is_err_and(|text| text.contains("the len is 0 but the index is 2")));
        assert_eq!(caught(|| -> u8 { panic!("plain") }), Err(Panicked("plain".to_string())));
        assert_eq!(caught(|| -> u8 { std::panic::panic_any(7) }), Err(Panicked("no message".to_string())));
    }
}
