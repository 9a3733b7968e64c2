//! What resolver and encoder report of the shaft, to the controller and to the observer alike.

use super::form::Form;
use super::layout::*;
use super::shaft::ShaftState;
use crate::control::position_speed::{ControlParameter, Feedback};
use crate::details;
use crate::kept;
use crate::scalar::Scalar;
use crate::sensor::encoder::{Encoder, EncoderState};
use crate::sensor::resolver::{Reading, Resolver, ResolverState};

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
        shown = feedback != Feedback::Output;
        noisy = Resolver::<f64>::noisy(&parts.resolver());
        /// The encoder loses counts, or stands still: it has a counter to follow.
        counting = Encoder::<f64>::loses(&parts.encoder());
        /// The interpolation of the encoder errs.
        interpolated = Encoder::<f64>::errs(&parts.encoder());
    }
    extra {
        /// The commutation has a track of its own.
        separate = (resolver || noisy) && !commutated;
        /// The controller alone reads the resolver, and that forgets what it showed.
        unread = separate && !Resolver::<f64>::remembers(&parts.resolver());
    }
}

impl SensingDetails {
    /// Can the resolver report another angle than the shaft's?
    #[inline(always)]
    pub(super) fn distorts(&self) -> bool {
        self.resolver || self.noisy
    }
}

/// Constants of the position sensors.
#[derive(Clone, Copy, Debug)]
pub struct Sensing<S> {
    encoder: Encoder<S>,
    resolver: Resolver<S>,
}

/// What the position sensors remember.
#[derive(Clone, Copy, Debug)]
pub struct Sensed<S> {
    resolver: ResolverState<S>,
    /// Of the resolver, angle and speed, of unit deviation.
    pub noise: [S; 2],
    encoder: EncoderState<S>,
}

kept!(Sensed<f64> as Sensed { resolver, noise, encoder });

impl<S: Scalar> Sensing<S> {
    pub(super) fn derive(raw: &[S], d: &SensingDetails) -> Self {
        let turn = if d.linear { 1.0 } else { std::f64::consts::TAU };
        Self { encoder: Encoder::derive(Raw(raw).encoder(), turn, d.linear), resolver: Resolver::derive(Raw(raw).resolver()) }
    }

    /// As the reduced-order model has them.
    pub(super) fn derive_low(raw: &[S], d: &SensingDetails) -> Self {
        Self { resolver: Resolver::without_leaps(Raw(raw).resolver()), ..Self::derive(raw, d) }
    }

    pub(super) fn start(&self, s: &ShaftState<S>) -> Sensed<S> {
        let resolver = ResolverState { angle: s.motor_position, speed: s.motor_speed };
        Sensed { resolver, noise: [S::zero(); 2], encoder: self.encoder.start(self.encoder.interpolated(s.output_position)) }
    }

    /// What the sensors remember begins at what they would show now, where nothing remembered before.
    pub(super) fn join(&self, before: &SensingDetails, after: &SensingDetails, s: &ShaftState<S>, sensed: &mut Sensed<S>) {
        let fresh = self.start(s);
        if after.resolver && !before.resolver {
            sensed.resolver = fresh.resolver;
        }
        if after.counting && !before.counting {
            sensed.encoder = fresh.encoder;
        }
    }

    /// The resolver has no power or no signal.
    #[inline(always)]
    pub(super) fn lost(&self) -> S::Mask {
        S::splat(0.5).lt(self.resolver.off)
    }

    /// How far the resolver is from the shaft, as long as it has power.
    pub(super) fn errors(&self) -> S {
        self.resolver.errors()
    }

    /// Change of the reported speed over that of the shaft's.
    #[inline(always)]
    pub(super) fn follows(&self) -> S {
        self.resolver.follows()
    }

    /// Angle that the resolver would report elsewhere.
    #[inline(always)]
    pub(super) fn angle(&self, position: S, speed: S, sensed: Sensed<S>) -> S {
        let mut memory = sensed.resolver;
        self.resolver.read(position, speed, &mut memory).angle
    }

    /// The resolver's reading.
    #[inline(always)]
    pub(super) fn shaft<const FULL: bool>(&self, d: &SensingDetails, s: &ShaftState<S>, sensed: &mut Sensed<S>) -> Reading<S> {
        let mut reading = Reading { angle: s.motor_position, position: s.motor_position, speed: s.motor_speed };
        if FULL && d.resolver {
            reading = self.resolver.read(s.motor_position, s.motor_speed, &mut sensed.resolver);
        }
        if FULL && d.noisy {
            reading = self.resolver.disturbed(reading, sensed.noise);
        }
        reading
    }

    /// Position of the encoder, which counts on to the present.
    #[inline(always)]
    pub(super) fn count<const FULL: bool>(&self, d: &SensingDetails, s: &ShaftState<S>, sensed: &mut Sensed<S>) -> S {
        let output = if FULL && d.interpolated { self.encoder.interpolated(s.output_position) } else { s.output_position };
        if FULL && d.counting {
            self.encoder.advance(output, &mut sensed.encoder);
            sensed.encoder.reading
        } else {
            self.encoder.read(output)
        }
    }

    /// What closes the position loop.
    #[inline(always)]
    pub(super) fn output<const FULL: bool>(
        &self,
        d: &SensingDetails,
        s: &ShaftState<S>,
        sensed: &mut Sensed<S>,
        reading: &Reading<S>,
        per_ratio: S,
    ) -> S {
        match d.feedback {
            Feedback::Encoder if FULL => self.count::<true>(d, s, sensed),
            Feedback::Resolver if FULL => reading.position * per_ratio,
            _ => s.output_position,
        }
    }

    /// Position of the encoder; position, speed and signal of the resolver.
    #[inline(always)]
    pub(super) fn readings(&self, d: &SensingDetails, s: &ShaftState<S>, sensed: Sensed<S>) -> [S; 4] {
        let mut sensed = sensed;
        let reading = self.shaft::<true>(d, s, &mut sensed);
        let signal = if d.resolver { self.resolver.signal(s.motor_position) } else { S::one() };
        [self.count::<true>(d, s, &mut sensed), reading.position, reading.speed, signal]
    }
}
