//! A component of a simulation as FMI has it, whatever the version: its life, its variables, its states. No pointer comes here.

mod state;

use crate::run::{Fault, Run, Verdict};
use crate::spec::{Kind, Spec, Variable};
use crate::text::Text;

/// Status of a call, by FMI's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    Ok = 0,
    Warning = 1,
    /// Not done: this value, this step.
    Discard = 2,
    Error = 3,
    Fatal = 4,
}

pub type Done<T = ()> = Result<T, Status>;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    Instantiated,
    Initialising,
    Stepping,
    Terminated,
}

/// In what form a variable's values are numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    Real,
    Whole,
    Choice,
}

fn form(variable: &Variable) -> Form {
    match (variable.choice, variable.whole) {
        (true, _) => Form::Choice,
        (_, true) => Form::Whole,
        _ => Form::Real,
    }
}

/// Largest seed: a whole number of 32 bits.
const MOST_SEED: f64 = 2_147_483_647.0;

pub struct Component {
    document: Spec,
    /// With all that has been set.
    spec: Spec,
    run: Option<Run>,
    /// The run is not what `spec` states now.
    stale: bool,
    pub phase: Phase,
    /// Time at the start, s.
    start: f64,
    /// The run stands and cannot go on.
    pub ended: bool,
    /// The importer knows of the trip.
    trip_reported: bool,
    pub text: Text,
}

impl Component {
    pub fn new(document: Spec) -> Self {
        Self {
            spec: document.clone(),
            document,
            run: None,
            stale: true,
            phase: Phase::Instantiated,
            start: 0.0,
            ended: false,
            trip_reported: false,
            text: Text::default(),
        }
    }

    fn say<T>(&mut self, status: Status, text: std::fmt::Arguments<'_>) -> Done<T> {
        self.text.set(text);
        Err(status)
    }

    /// Is the component in one of these phases?
    ///
    /// # Errors
    /// It is not.
    pub fn within(&mut self, phases: &[Phase], call: &str) -> Done {
        if phases.contains(&self.phase) {
            return Ok(());
        }
        let phase = self.phase;
        self.say(Status::Error, format_args!("{call}: not allowed while {phase:?}"))
    }

    /// What this FMU does not have.
    ///
    /// # Errors
    /// Always.
    pub fn absent(&mut self, what: &str) -> Done {
        self.say(Status::Error, format_args!("{what}: this FMU has no such thing"))
    }

    /// # Errors
    /// A start that is no number, or too late for it.
    pub fn set_start(&mut self, start: f64) -> Done {
        self.within(&[Phase::Instantiated], "start time")?;
        if !start.is_finite() {
            return self.say(Status::Error, format_args!("start time {start} is not a number"));
        }
        self.start = start;
        Ok(())
    }

    /// # Errors
    /// Out of turn.
    pub fn enter_initialisation(&mut self) -> Done {
        self.within(&[Phase::Instantiated], "EnterInitializationMode")?;
        self.phase = Phase::Initialising;
        Ok(())
    }

    /// # Errors
    /// Out of turn, or values that cannot be together.
    pub fn exit_initialisation(&mut self) -> Done {
        self.within(&[Phase::Initialising], "ExitInitializationMode")?;
        self.made()?;
        self.phase = Phase::Stepping;
        Ok(())
    }

    /// # Errors
    /// Out of turn.
    pub fn terminate(&mut self) -> Done {
        self.within(&[Phase::Stepping], "Terminate")?;
        self.phase = Phase::Terminated;
        Ok(())
    }

    pub fn reset(&mut self) {
        *self = Self::new(self.document.clone());
    }

    /// The run as it is stated now.
    fn made(&mut self) -> Done<&mut Run> {
        if self.stale || self.run.is_none() {
            match Run::new(&self.spec) {
                Ok(run) => self.run = Some(run),
                Err(reason) => return self.say(Status::Error, format_args!("{reason}")),
            }
            self.stale = false;
        }
        self.run.as_mut().ok_or(Status::Fatal)
    }

    /// s.
    pub fn time(&self) -> f64 {
        self.start + self.run.as_ref().map_or(0.0, Run::time)
    }

    /// Steps on from `time` by `step`, s.
    ///
    /// # Errors
    /// Times that cannot be (Error), no whole number of solver steps (Discard), a run that stands.
    pub fn step(&mut self, time: f64, step: f64) -> Done {
        self.within(&[Phase::Stepping], "DoStep")?;
        let now = self.time();
        let dt = self.run.as_ref().map_or(0.0, Run::dt);
        if !time.is_finite() || !step.is_finite() || step <= 0.0 {
            return self.say(Status::Error, format_args!("DoStep from {time} s by {step} s: a finite time and a step above 0 expected"));
        }
        if (time - now).abs() > 1e-3 * dt + 1e-12 * now.abs() {
            return self.say(Status::Error, format_args!("DoStep from {time} s: the component is at {now} s"));
        }
        if self.ended {
            return self.say(Status::Discard, format_args!("the run has ended at {now} s"));
        }
        let Some(run) = &mut self.run else {
            return Err(Status::Fatal);
        };
        match run.advance(step) {
            Ok(Verdict::Ok) => Ok(()),
            Ok(Verdict::Tripped) => self.report_trip(),
            Ok(Verdict::Overheated) => self.end(Status::Discard),
            Err(Fault::Ended) => self.end(Status::Error),
            Err(_) => self.refused(Status::Discard),
        }
    }

    /// The first step after a trip states it.
    fn report_trip(&mut self) -> Done {
        if std::mem::replace(&mut self.trip_reported, true) {
            return Ok(());
        }
        if let Some(run) = &mut self.run {
            run.trip_text();
        }
        self.refused(Status::Warning)
    }

    fn end(&mut self, status: Status) -> Done {
        self.ended = true;
        self.refused(status)
    }

    /// With the run's text.
    fn refused<T>(&mut self, status: Status) -> Done<T> {
        if let Some(run) = &self.run {
            self.text = run.text.clone();
        }
        Err(status)
    }

    /// The variable of a value reference, if its values have one of these forms.
    fn variable(&mut self, reference: u32, forms: &[Form]) -> Done<Kind> {
        match self.spec.variables.get(reference as usize) {
            Some(variable) if forms.contains(&form(variable)) => Ok(variable.kind),
            Some(variable) => {
                let (name, is) = (variable.name.clone(), form(variable));
                self.say(Status::Error, format_args!("{name} (value reference {reference}) is of another type ({is:?})"))
            }
            None => self.say(Status::Error, format_args!("no variable has the value reference {reference}")),
        }
    }

    /// # Errors
    /// No such variable of this form, or none that has a value yet.
    pub fn get(&mut self, reference: u32, forms: &[Form]) -> Done<f64> {
        let kind = self.variable(reference, forms)?;
        let choice = f64::from(u8::from(self.spec.variables[reference as usize].choice));
        Ok(match kind {
            Kind::Time => self.time(),
            Kind::Parameter(at) => choice + self.spec.parameters.get(at).copied().unwrap_or(0.0),
            Kind::Seed => self.spec.seed as f64,
            Kind::Prepared => self.spec.prepared as f64 + 1.0,
            Kind::Attribute(fault, at) => self.spec.faults[fault].attributes[at].1,
            Kind::Input(port) => match (&self.run, self.phase) {
                (Some(run), Phase::Stepping | Phase::Terminated) => run.inputs()[port],
                _ => self.spec.inputs[port].unwrap_or_else(|| self.spec.fallback(port)),
            },
            Kind::Fault(at) => match (&self.run, self.phase) {
                (Some(run), Phase::Stepping | Phase::Terminated) => run.severities()[at],
                _ => self.spec.faults[at].severity,
            },
            Kind::Output(at) => return self.output(at),
        })
    }

    fn output(&mut self, at: usize) -> Done<f64> {
        self.within(&[Phase::Initialising, Phase::Stepping, Phase::Terminated], "an output is read")?;
        match self.phase {
            Phase::Initialising => Ok(self.made()?.read_one(at)),
            _ => self.run.as_mut().map(|run| run.read_one(at)).ok_or(Status::Fatal),
        }
    }

    /// Several variables at once, all or none of them.
    ///
    /// # Errors
    /// As `check`, or severities that cannot be together.
    pub fn set(&mut self, references: &[u32], forms: &[Form], value: impl Fn(usize) -> f64 + Copy) -> Done {
        for (i, &reference) in references.iter().enumerate() {
            self.check(reference, forms, value(i))?;
        }
        if self.phase != Phase::Stepping {
            for (i, &reference) in references.iter().enumerate() {
                self.note(reference, value(i));
            }
            // Nothing set leaves the run as it is, also after the end.
            self.stale |= !references.is_empty();
            return Ok(());
        }
        let Some(run) = &mut self.run else {
            return Err(Status::Fatal);
        };
        let kinds = references.iter().map(|&reference| self.spec.variables[reference as usize].kind);
        let severity = |(i, kind)| if let Kind::Fault(at) = kind { Some((at, value(i))) } else { None };
        if run.set_severities(kinds.clone().enumerate().filter_map(severity)).is_err() {
            return self.refused(Status::Discard);
        }
        for (i, kind) in kinds.enumerate() {
            if let Kind::Input(port) = kind {
                // It was checked before.
                let _ = run.set_input(port, value(i));
            }
        }
        Ok(())
    }

    /// Would a variable take a value now?
    fn check(&mut self, reference: u32, forms: &[Form], value: f64) -> Done {
        let kind = self.variable(reference, forms)?;
        let early = [Phase::Instantiated, Phase::Initialising];
        match kind {
            Kind::Time | Kind::Output(_) => self.say(Status::Error, format_args!("value reference {reference}: no variable to set")),
            Kind::Parameter(_) | Kind::Seed | Kind::Prepared | Kind::Attribute(..) => {
                self.within(&early, "a fixed parameter is set")?;
                self.check_fixed(reference, kind, value)
            }
            Kind::Input(_) | Kind::Fault(_) if self.phase == Phase::Terminated => self.within(&early, "an input is set"),
            Kind::Input(port) if self.phase == Phase::Stepping => match self.run.as_mut().map(|run| run.check_input(port, value)) {
                Some(Ok(())) => Ok(()),
                Some(Err(Fault::Argument)) => self.refused(Status::Error),
                Some(Err(_)) => self.refused(Status::Discard),
                None => Err(Status::Fatal),
            },
            Kind::Input(_) | Kind::Fault(_) => self.check_number(reference, value),
        }
    }

    fn check_number(&mut self, reference: u32, value: f64) -> Done {
        if value.is_finite() {
            return Ok(());
        }
        self.say(Status::Error, format_args!("value reference {reference}: {value} is not a number"))
    }

    fn check_fixed(&mut self, reference: u32, kind: Kind, value: f64) -> Done {
        self.check_number(reference, value)?;
        let choice = f64::from(u8::from(self.spec.variables[reference as usize].choice));
        let fits = match kind {
            Kind::Parameter(at) => self.spec.ranges().nth(at).is_some_and(|range| range.contains(value - choice)),
            Kind::Prepared => (1.0..=self.spec.faults.len() as f64 + 2.0).contains(&value) && value.fract() == 0.0,
            Kind::Seed => (0.0..=MOST_SEED).contains(&value) && value.fract() == 0.0,
            _ => true,
        };
        if fits {
            return Ok(());
        }
        let name = self.spec.variables[reference as usize].name.clone();
        self.say(Status::Discard, format_args!("{name}: {value} is outside its range"))
    }

    /// Takes a checked value for the run to come.
    fn note(&mut self, reference: u32, value: f64) {
        let variable = &self.spec.variables[reference as usize];
        match variable.kind {
            Kind::Parameter(at) => self.spec.parameters[at] = value - f64::from(u8::from(variable.choice)),
            Kind::Seed => self.spec.seed = value as u64,
            Kind::Prepared => self.spec.prepared = value as u64 - 1,
            Kind::Attribute(fault, at) => self.spec.faults[fault].attributes[at].1 = value,
            Kind::Input(port) => self.spec.inputs[port] = Some(value),
            Kind::Fault(at) => self.spec.faults[at].severity = value,
            Kind::Time | Kind::Output(_) => {}
        }
    }
}
