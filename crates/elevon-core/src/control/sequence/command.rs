//! Commands: accepted, refused, repeated; and the notes from which a run states what went otherwise than commanded.

use super::codes::*;
use super::{Phase, Seen, Sequence, SequenceParameter as P};
use crate::kept;
use crate::kept::{Kept, Store};

/// Something that did not go as it was commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Note {
    Refused {
        time: f64,
        command: u8,
        reason: u8,
        value: f64,
    },
    /// The unit went to its fault state; the command it was carrying out (stop: it was at rest), and the warning that
    /// names a switch.
    Failed {
        time: f64,
        fault: u8,
        command: u8,
        warning: u8,
    },
    /// The ram rests short of its lock after the release.
    Hanging {
        time: f64,
        place: f64,
    },
}

/// The first notes of a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct Notes {
    list: [Option<Note>; 6],
}

kept!(Notes as Notes { list });

impl Default for Note {
    fn default() -> Self {
        Self::Hanging { time: 0.0, place: 0.0 }
    }
}

impl Kept for Note {
    /// Kind, time, three codes, a value: those that a kind lacks are zero.
    fn keep(&mut self, store: &mut Store) {
        let (mut kind, mut time, mut codes, mut value) = match *self {
            Self::Refused { time, command, reason, value } => (0_u8, time, [command, reason, 0], value),
            Self::Failed { time, fault, command, warning } => (1, time, [fault, command, warning], 0.0),
            Self::Hanging { time, place } => (2, time, [0; 3], place),
        };
        kind.keep(store);
        time.keep(store);
        codes.keep(store);
        value.keep(store);
        let [first, second, third] = codes;
        *self = match kind {
            0 => Self::Refused { time, command: first, reason: second, value },
            1 => Self::Failed { time, fault: first, command: second, warning: third },
            2 => Self::Hanging { time, place: value },
            _ => return store.refuse(),
        };
    }
}

impl Notes {
    pub fn add(&mut self, note: Note) {
        if let Some(free) = self.list.iter_mut().find(|entry| entry.is_none()) {
            *free = Some(note);
        }
    }

    pub fn any(&self) -> bool {
        self.list[0].is_some()
    }

    pub fn text(&self) -> Option<String> {
        let texts: Vec<String> = self.list.iter().flatten().map(Note::text).collect();
        (!texts.is_empty()).then(|| texts.join("; "))
    }
}

impl Note {
    fn text(&self) -> String {
        let name = |command: &u8| COMMANDS[usize::from(*command)];
        match self {
            Note::Refused { time, command, reason, value } => {
                let voltage = if matches!(*reason, SUPPLY_LOW | SUPPLY_HIGH) { format!(" ({value:.1} V)") } else { String::new() };
                format!("{} refused at {time:.2} s: {}{voltage}", name(command), REFUSALS[usize::from(*reason)])
            }
            Note::Failed { time, fault, command, warning } => {
                let switch =
                    if *fault == PROXIMITY && (SWITCH..HALL_POWER).contains(warning) { WARNINGS[usize::from(*warning)] } else { "" };
                let cause = if switch.is_empty() { FAULTS[usize::from(*fault)] } else { switch };
                match *command {
                    STOP => format!("fault of the control unit at rest at {time:.2} s: {cause}"),
                    _ => format!("{} did not arrive, fault of the control unit at {time:.2} s: {cause}", name(command)),
                }
            }
            Note::Hanging { time, place } => format!("free_fall did not lock: the ram rests at {:.1} mm at {time:.2} s", 1e3 * place),
        }
    }
}

impl Sequence {
    pub(super) fn take_command(&mut self, p: &[f64], see: &Seen) {
        if see.command == self.last {
            return;
        }
        let number = COMMANDS.len() as u8;
        let (command, before) = (see.command % number, self.last % number);
        self.last = see.command;
        if command == STOP {
            self.wanted = STOP;
            self.cleared = self.phase == Phase::Fault;
            self.refused = 0;
            return;
        }
        if command == before && command == self.wanted {
            self.refused = REPEATED;
            return;
        }
        match self.refusal(p, see, command) {
            Some((reason, value)) => {
                self.refused = reason;
                self.notes.add(Note::Refused { time: see.time, command, reason, value });
            }
            None => {
                self.refused = 0;
                self.warning = 0;
                self.wanted = command;
                self.retries = 0.0;
            }
        }
    }

    fn refusal(&self, p: &[f64], see: &Seen, command: u8) -> Option<(u8, f64)> {
        if command == FREE_FALL {
            return self.fall_refusal();
        }
        if self.apart() {
            return Some((RELEASED_ALREADY, 1.0));
        }
        if self.phase == Phase::Fault && !self.cleared {
            return Some((IN_FAULT, f64::from(self.fault)));
        }
        if see.supply < p[P::Undervoltage as usize] {
            return Some((SUPPLY_LOW, see.supply));
        }
        if see.supply > p[P::Overvoltage as usize] {
            return Some((SUPPLY_HIGH, see.supply));
        }
        (command == RETRACT && self.on_wheels(p)).then_some((ON_WHEELS, 1.0))
    }

    /// An emergency command is refused for a lock alone, which its switch shows and a motion has confirmed. Weight on wheels
    /// has no second indication: the place of the leg says nothing of the ground.
    fn fall_refusal(&self) -> Option<(u8, f64)> {
        (self.phase == Phase::Locked).then_some((LOCK_ENGAGED, 1.0))
    }
}
