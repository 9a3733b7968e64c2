//! What resolver and encoder show of the shaft, to the controller and to the observer alike.

use super::form::Form;
use super::layout::*;
use super::shaft::ShaftState;
use crate::control::position_speed::{ControlParameter, Feedback};
use crate::details;
use crate::scalar::Scalar;
use crate::sensor::encoder::Encoder;
use crate::sensor::resolver::{Reading, Resolver};

details! {
    /// What of the position sensors a run needs.
    SensingDetails, read<F>(parts: Parts)
    always {
        feedback: Feedback = Feedback::read(parts.control().value(ControlParameter::PositionFeedback));
        /// A lost resolver turns the field, too.
        commutated: bool = CommutationSource::read(parts.drive().value(DriveParameter::CommutationSource)) == CommutationSource::Resolver;
        linear: bool = F::LINEAR;
    }
    full {
        resolver = Resolver::<f64>::needed(&parts.resolver());
        shown = feedback != Feedback::User;
    }
    extra {
        /// The commutation has a track of its own.
        separate = resolver && !commutated;
    }
}

/// Constants of the position sensors.
#[derive(Clone, Copy, Debug)]
pub struct Sensing<S> {
    encoder: Encoder<S>,
    resolver: Resolver<S>,
}

impl<S: Scalar> Sensing<S> {
    pub(super) fn derive(raw: &[S], d: &SensingDetails) -> Self {
        let turn = if d.linear { 1.0 } else { std::f64::consts::TAU };
        Self { encoder: Encoder::derive(Raw(raw).encoder(), turn), resolver: Resolver::derive(Raw(raw).resolver()) }
    }

    /// The resolver's reading; `held` is the last angle shown with power on.
    #[inline(always)]
    pub(super) fn shaft<const FULL: bool>(&self, d: &SensingDetails, s: &ShaftState<S>, held: &mut S) -> Reading<S> {
        if FULL && d.resolver {
            self.resolver.read(s.motor_position, s.motor_speed, held)
        } else {
            Reading { angle: s.motor_position, position: s.motor_position, speed: s.motor_speed }
        }
    }

    /// What closes the position loop.
    #[inline(always)]
    pub(super) fn user<const FULL: bool>(&self, d: &SensingDetails, s: &ShaftState<S>, reading: &Reading<S>, per_ratio: S) -> S {
        match d.feedback {
            Feedback::Encoder if FULL => self.encoder.read(s.user_position),
            Feedback::Resolver if FULL => reading.position * per_ratio,
            _ => s.user_position,
        }
    }

    /// Position of the encoder, position and speed of the resolver.
    #[inline(always)]
    pub(super) fn show(&self, d: &SensingDetails, s: &ShaftState<S>, held: S) -> [S; 3] {
        let mut held = held;
        let reading = self.shaft::<true>(d, s, &mut held);
        [self.encoder.read(s.user_position), reading.position, reading.speed]
    }
}
