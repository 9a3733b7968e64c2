//! The text of the last error: in memory of its own, so that no error of a running instance takes any.

use std::ffi::{c_char, CStr};
use std::fmt::{self, Write};

const ROOM: usize = 512;

/// As much of a text as there is room for, with the zero that C needs.
#[derive(Clone)]
pub struct Text {
    bytes: [u8; ROOM],
    length: usize,
}

impl Default for Text {
    fn default() -> Self {
        Self { bytes: [0; ROOM], length: 0 }
    }
}

impl Text {
    /// Replaces the text.
    pub fn set(&mut self, text: fmt::Arguments<'_>) {
        self.length = 0;
        // What does not fit is left out: `write_str` never fails.
        let _ = self.write_fmt(text);
        self.bytes[self.length] = 0;
    }

    pub fn as_ptr(&self) -> *const c_char {
        self.bytes.as_ptr().cast()
    }

    pub fn as_c(&self) -> &CStr {
        CStr::from_bytes_until_nul(&self.bytes).unwrap_or_default()
    }
}

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&String::from_utf8_lossy(&self.bytes[..self.length]))
    }
}

impl Write for Text {
    fn write_str(&mut self, part: &str) -> fmt::Result {
        let mut room = part.len().min(ROOM - 1 - self.length);
        while !part.is_char_boundary(room) {
            room -= 1;
        }
        self.bytes[self.length..self.length + room].copy_from_slice(&part.as_bytes()[..room]);
        self.length += room;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_ends_where_its_room_ends() {
        let mut text = Text::default();
        text.set(format_args!("{}é", "x".repeat(ROOM - 2)));
        assert_eq!(text.to_string(), "x".repeat(ROOM - 2));
        text.set(format_args!("short"));
        assert_eq!(text.as_c().to_bytes(), b"short");
    }
}
