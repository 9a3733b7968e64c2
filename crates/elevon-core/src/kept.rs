//! What a run remembers, as bytes: written to memory of the caller's and read back, bit for bit.

/// Bytes that a state is written to or read from, eight a number. Beyond their end nothing is written, and `at` counts on:
/// so the same walk tells how many a state takes.
#[derive(Debug)]
pub struct Store<'a> {
    bytes: Bytes<'a>,
    at: usize,
    sound: bool,
}

#[derive(Debug)]
enum Bytes<'a> {
    To(&'a mut [u8]),
    From(&'a [u8]),
}

impl<'a> Store<'a> {
    pub fn to(bytes: &'a mut [u8]) -> Self {
        Self { bytes: Bytes::To(bytes), at: 0, sound: true }
    }

    pub fn from(bytes: &'a [u8]) -> Self {
        Self { bytes: Bytes::From(bytes), at: 0, sound: true }
    }

    /// Bytes walked over.
    pub fn at(&self) -> usize {
        self.at
    }

    /// Was all there, and of the kind that was asked for?
    pub fn sound(&self) -> bool {
        self.sound
    }

    /// What was read is none of what may stand here.
    pub fn refuse(&mut self) {
        self.sound = false;
    }

    /// Is it read from?
    pub fn reads(&self) -> bool {
        matches!(self.bytes, Bytes::From(_))
    }

    /// Keeps marks; true where they are what they were.
    pub fn unchanged(&mut self, marks: &mut [bool]) -> bool {
        let mut same = true;
        for mark in marks {
            let before = *mark;
            mark.keep(self);
            same &= before == *mark;
        }
        same
    }

    /// The number as it is kept from now on: the given one, or the one read.
    pub fn word(&mut self, number: u64) -> u64 {
        let place = self.at..self.at + 8;
        self.at += 8;
        match &mut self.bytes {
            Bytes::To(bytes) => {
                if let Some(part) = bytes.get_mut(place) {
                    part.copy_from_slice(&number.to_le_bytes());
                }
                number
            }
            Bytes::From(bytes) => match bytes.get(place).and_then(|part| part.try_into().ok()) {
                Some(part) => u64::from_le_bytes(part),
                None => {
                    self.sound = false;
                    number
                }
            },
        }
    }
}

/// Something of a run's state.
pub trait Kept {
    /// Writes it to the store, or becomes what is read there.
    fn keep(&mut self, store: &mut Store);
}

impl Kept for u64 {
    fn keep(&mut self, store: &mut Store) {
        *self = store.word(*self);
    }
}

impl Kept for f64 {
    fn keep(&mut self, store: &mut Store) {
        *self = Self::from_bits(store.word(self.to_bits()));
    }
}

impl Kept for bool {
    fn keep(&mut self, store: &mut Store) {
        match store.word(u64::from(*self)) {
            0 => *self = false,
            1 => *self = true,
            _ => store.refuse(),
        }
    }
}

impl Kept for u8 {
    fn keep(&mut self, store: &mut Store) {
        match Self::try_from(store.word(u64::from(*self))) {
            Ok(read) => *self = read,
            Err(_) => store.refuse(),
        }
    }
}

impl<T: Kept> Kept for [T] {
    fn keep(&mut self, store: &mut Store) {
        self.iter_mut().for_each(|item| item.keep(store));
    }
}

impl<T: Kept, const N: usize> Kept for [T; N] {
    fn keep(&mut self, store: &mut Store) {
        self.as_mut_slice().keep(store);
    }
}

/// As many as there are already.
impl<T: Kept> Kept for Vec<T> {
    fn keep(&mut self, store: &mut Store) {
        self.as_mut_slice().keep(store);
    }
}

impl<A: Kept, B: Kept> Kept for (A, B) {
    fn keep(&mut self, store: &mut Store) {
        self.0.keep(store);
        self.1.keep(store);
    }
}

impl<T: Kept + Default> Kept for Option<T> {
    fn keep(&mut self, store: &mut Store) {
        let mut some = self.is_some();
        some.keep(store);
        let mut held = self.take().unwrap_or_default();
        held.keep(store);
        *self = some.then_some(held);
    }
}

/// One of some choices, by its place among them.
pub fn keep_choice<T: Copy + PartialEq>(choice: &mut T, all: &[T], store: &mut Store) {
    let place = all.iter().position(|other| other == choice).unwrap_or_default();
    match all.get(store.word(place as u64) as usize) {
        Some(&read) => *choice = read,
        None => store.refuse(),
    }
}

/// `kept!(State<f64> { a, b })`: all its fields, in this order; the compiler requires each of them.
#[macro_export]
macro_rules! kept {
    ($name:ty as $pattern:ident { $($field:ident),* $(,)? }) => {
        impl $crate::kept::Kept for $name {
            fn keep(&mut self, store: &mut $crate::kept::Store) {
                let $pattern { $($field),* } = self;
                $($crate::kept::Kept::keep($field, store);)*
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, Default, PartialEq)]
    struct Parts {
        number: f64,
        flags: [bool; 2],
        code: Option<u8>,
    }
    kept!(Parts as Parts { number, flags, code });

    #[test]
    fn what_is_written_is_read_back() {
        let mut parts = Parts { number: f64::NEG_INFINITY, flags: [true, false], code: Some(7) };
        let mut count = Store::to(&mut []);
        parts.keep(&mut count);
        let mut bytes = vec![0; count.at()];
        parts.keep(&mut Store::to(&mut bytes));
        let mut again = Parts::default();
        let mut store = Store::from(&bytes);
        again.keep(&mut store);
        assert!(store.sound());
        assert_eq!(again, parts);
    }

    #[test]
    fn what_is_short_or_of_another_kind_is_seen() {
        let mut parts = Parts::default();
        let mut short = Store::from(&[0; 16]);
        parts.keep(&mut short);
        assert!(!short.sound());
        let mut wrong = Store::from(&[9; 40]);
        parts.keep(&mut wrong);
        assert!(!wrong.sound());
    }
}
