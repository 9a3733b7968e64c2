//! A component's state as bytes, and back.

use super::{Component, Done, Phase, Status};
use crate::run::Run;
use crate::spec::digest;
use elevon_core::kept::{Kept, Store};

const PHASES: [Phase; 4] = [Phase::Instantiated, Phase::Initialising, Phase::Stepping, Phase::Terminated];

/// Length of what stands before a state: its digest, and that of the document.
const HEADER: usize = 16;

impl Component {
    /// The whole component as bytes.
    ///
    /// # Errors
    /// Values that cannot be together.
    pub fn save(&mut self) -> Done<Vec<u8>> {
        let mut count = Store::to(&mut []);
        self.keep_outside(&mut count);
        let mut bytes = vec![0; HEADER + count.at()];
        self.keep_outside(&mut Store::to(&mut bytes[HEADER..]));
        if let Some(run) = self.run.as_mut().filter(|_| !self.stale) {
            let (begin, size) = (bytes.len(), run.state_size());
            bytes.resize(begin + size, 0);
            if run.save(&mut bytes[begin..]).is_err() {
                return self.refused(Status::Error);
            }
        }
        let mut head = [digest(&bytes[HEADER..]), self.document.identity];
        head.keep(&mut Store::to(&mut bytes[..HEADER]));
        Ok(bytes)
    }

    /// Are the bytes a state of this FMU, as it was written?
    ///
    /// # Errors
    /// They are not.
    pub fn check_state(&mut self, bytes: &[u8]) -> Done {
        let mut head = [0_u64; 2];
        let mut store = Store::from(bytes);
        head.keep(&mut store);
        let body = bytes.get(HEADER..).unwrap_or_default();
        if store.sound() && head == [digest(body), self.document.identity] {
            return Ok(());
        }
        self.say(Status::Error, format_args!("no state of this FMU, or a damaged one"))
    }

    /// Goes back, or forth, to a state of a component of the same document.
    ///
    /// # Errors
    /// Bytes that are none.
    pub fn restore(&mut self, bytes: &[u8]) -> Done {
        self.check_state(bytes)?;
        let body = bytes.get(HEADER..).unwrap_or_default();
        let mut other = Self::new(self.document.clone());
        let mut store = Store::from(body);
        other.keep_outside(&mut store);
        let (read, sound) = (store.at(), store.sound());
        let rest = body.get(read..).unwrap_or_default();
        if !sound {
            return self.say(Status::Error, format_args!("the state has entries that cannot be"));
        }
        if !rest.is_empty() {
            // Its bytes are as they were written: what fails now is a defect.
            self.bring(&mut other, rest).map_err(|_| Status::Fatal)?;
        }
        *self = other;
        Ok(())
    }

    /// Gives `other` the run that `state` describes: one made like this one's, where that fits.
    fn bring(&mut self, other: &mut Self, state: &[u8]) -> Done {
        let fitting = self.run.take().filter(|run| run.fits(&other.spec)).map_or_else(|| Run::new(&other.spec), Ok);
        match fitting {
            Ok(mut run) => {
                let restored = run.restore(state);
                self.text = run.text.clone();
                (other.run, other.stale) = (Some(run), false);
                restored.map_err(|_| Status::Error)
            }
            Err(reason) => self.say(Status::Error, format_args!("{reason}")),
        }
    }

    /// All but the run itself.
    fn keep_outside(&mut self, store: &mut Store) {
        elevon_core::kept::keep_choice(&mut self.phase, &PHASES, store);
        self.start.keep(store);
        self.ended.keep(store);
        self.trip_reported.keep(store);
        self.spec.parameters.keep(store);
        self.spec.seed.keep(store);
        self.spec.prepared.keep(store);
        self.spec.inputs.keep(store);
        for fault in &mut self.spec.faults {
            fault.severity.keep(store);
            fault.attributes.iter_mut().for_each(|(_, value)| value.keep(store));
        }
    }
}
