//! The motor shaft with all that turns or loads it, and the load side: one component of both fidelities. It knows the
//! loads, the friction (dry, viscous, of a preloaded or worn screw, of the load side), unbalance, seizure, stops and backlash,
//! and it keeps the accounts of their work.

mod bodies;
mod flank;
mod loads;
mod observe;
mod step;
mod train;

use self::bodies::Bodies;
use self::flank::Flank;
pub(super) use self::loads::Loads;
pub(super) use self::observe::ShaftSignals;
pub(super) use self::train::TRAIN;
use self::train::{Train, TrainDetails};
use super::form::Form;
use super::heat::network_period;
use super::layout::*;
use crate::details;
use crate::kept;
use crate::motor::cogging::Cogging;
use crate::motor::star::MotorParameter;
use crate::motor::thermal::Network;
use crate::motor::unbalance::Unbalance;
use crate::scalar::Scalar;
use crate::transmission::backlash::{Backlash, BacklashModel, BacklashParameter};
use crate::transmission::friction::Friction;
use crate::transmission::gear::{Gear, GearParameter, LoadParameter};
use crate::transmission::gear_train::{GearLayout, GearTrain};
use crate::transmission::lubricant::{Grease, Lubricant};
use crate::transmission::nut_heat::{NutHeat, NutState};
use crate::transmission::screw::Screw;
use crate::transmission::tooth::Teeth;
use crate::transmission::vibration::{Vibration, VibrationState};

details! {
    /// What of the shaft a run needs.
    ShaftDetails, read<F>(x: &ShaftNeeds)
    always {
        /// The output's side travels, and the brake acts there.
        linear: bool = F::LINEAR;
        /// Positions move with the new speed.
        semi_implicit: bool = x.semi_implicit;
        /// Positions move with the mean of both speeds: exact for a torque held over a long step. A spring needs the new
        /// speed, which neither feeds nor damps its swing; so do worn flanks under load and cogging.
        middle: bool = x.low
            && !x.parts.load().away(LoadParameter::Stiffness)
            && !Teeth::<f64>::needed(&x.parts.tooth())
            && !Cogging::<f64>::needed(&x.parts.cogging());
        train: TrainDetails = TrainDetails::read::<F>(x.parts);
        gear: GearLayout = x.gear;
    }
    full {
        elastic = x.elastic;
        /// The end stops are elastic.
        buffered = Gear::<f64>::buffered(&x.parts.stop());
        /// The gear winds up under what acts on the output, in proportion.
        compliant = x.low && x.winds() && x.loaded::<F>();
        /// A force or friction on the output decides which flank of the backlash carries.
        flanks = !x.elastic && (x.gapped() || compliant) && x.loaded::<F>();
        loaded = F::LINEAR || Gear::<f64>::loaded(&x.parts.gear());
        sloped = Friction::<f64>::sloped(&x.parts.friction());
        jams = Friction::<f64>::jams(&x.parts.friction());
        /// A constant load that belongs to the actuator.
        weight = x.parts.load().away(LoadParameter::Constant);
        /// The work of each load is summed.
        accounts = x.accounts;
    }
    extra {
        /// A load side with damping and dry friction of its own.
        load_side = F::LINEAR || x.parts.load().any_away([LoadParameter::Damping, LoadParameter::Friction]);
        unbalance = Unbalance::<f64>::needed(&x.parts.unbalance());
        preloaded = F::preloaded(x.parts.0);
        spall = F::spalled(x.parts.0);
        debris = F::contaminated(x.parts.0);
        detailed_train = train.extra;
        /// The screw's friction warms a nut.
        directed = Friction::<f64>::directed(&x.parts.friction());
        /// Friction changes with the temperature.
        lubricated = Grease::<f64>::needed(&x.parts.lubricant());
        nut = F::LINEAR && Network::<f64>::needed(&x.parts.thermal());
        vibrates = !x.low && F::vibrates(x.parts.0);
        /// Bodies between motor and output move by themselves.
        meshed = !x.low && gear.bodies();
    }
}

/// What a run reports of its shaft; the reduced-order model neither has the elastic backlash nor sums work.
pub(super) struct ShaftNeeds<'a> {
    pub parts: Parts<'a>,
    pub semi_implicit: bool,
    pub elastic: bool,
    pub accounts: bool,
    pub low: bool,
    pub gear: GearLayout,
}

impl<'a> ShaftNeeds<'a> {
    /// The second mass behind an elastic backlash, where the set has one.
    pub(super) fn high<F: Form>(parts: Parts<'a>, accounts: bool) -> Self {
        let semi_implicit = Method::read(parts.solver().value(SolverParameter::Method)) == Method::SemiImplicit;
        Self { parts, semi_implicit, elastic: elastic::<F>(parts.0.raw), accounts, low: false, gear: F::layout(parts.0.raw) }
    }

    pub(super) fn low<F: Form>(parts: Parts<'a>) -> Self {
        Self { parts, semi_implicit: true, elastic: false, accounts: false, low: true, gear: F::layout(parts.0.raw) }
    }

    /// Is there backlash, now or later?
    fn gapped(&self) -> bool {
        let backlash = self.parts.backlash();
        self.gear.bodies()
            || backlash.most(BacklashParameter::Total) > 0.0
            || backlash.most(BacklashParameter::Extra) > 0.0
            || Teeth::<f64>::needed(&self.parts.tooth())
    }

    /// Has the gear a stiffness?
    fn winds(&self) -> bool {
        self.gear.bodies() || BacklashModel::read(self.parts.backlash().value(BacklashParameter::Model)) == BacklashModel::Elastic
    }

    /// Does a force or friction act on the output, now or later?
    fn loaded<F: Form>(&self) -> bool {
        let driven = self.parts.0.driven;
        driven[OUTPUT]
            || F::LINEAR && driven[BRAKE]
            || self.parts.load().any_away([LoadParameter::Stiffness, LoadParameter::Constant, LoadParameter::Friction])
    }
}

/// Has the output a speed of its own in the switching model, behind an elastic backlash or the meshes of a gear?
pub(super) fn elastic<F: Form>(raw: &[f64]) -> bool {
    F::layout(raw).bodies() || BacklashModel::read(raw[BacklashParameter::Model.at()]) == BacklashModel::Elastic
}

/// Constants of the shaft.
#[derive(Clone, Copy, Debug)]
pub struct Shaft<S> {
    dt: S,
    pub friction: Friction<S>,
    grease: Grease<S>,
    pub gear: Gear<S>,
    pub backlash: Backlash<S>,
    /// Angle of the output per torque on it while the motor stands.
    compliance: S,
    gear_train: GearTrain<S>,
    pub screw: Screw<S>,
    /// Static over dynamic friction of the screw.
    stick: S,
    pub nut: NutHeat<S>,
    vibration: Vibration<S>,
    pub unbalance: Unbalance<S>,
    train: Train<S>,
    /// Of the motor shaft; with a rigid transmission the output's included.
    pub inertia: S,
    /// Of the motor shaft alone.
    rotor_inertia: S,
    /// Of the whole train, at the motor shaft.
    pub whole_inertia: S,
    dt_per_inertia: S,
    dt_per_rotor: S,
    /// Of the second mass, where it ever moves by itself.
    pub output_inertia: S,
    per_output_inertia: S,
    /// Dry friction and damping of the load side.
    load_friction: S,
    load_damping: S,
}

#[derive(Clone, Copy, Debug)]
pub struct ShaftState<S> {
    pub motor_position: S,
    pub motor_speed: S,
    pub output_position: S,
    pub output_speed: S,
    jam_side: S,
    jammed: S,
    /// Factor on the dry friction of a screw with debris in it.
    pub scatter: S,
    /// Largest motor speed so far, before stops: what a stop ends within a step is found, too.
    pub fastest: S,
    /// Deflection of the bristles.
    bristle: S,
    lubricant: Lubricant<S>,
    pub nut: NutState<S>,
    pub vibration: VibrationState<S>,
    flank: Flank<S>,
    pub bodies: Bodies<S>,
    pub work: Work<S>,
}

kept!(ShaftState<f64> as ShaftState {
    motor_position, motor_speed, output_position, output_speed, jam_side, jammed, scatter, fastest, bristle, lubricant, nut, vibration,
    flank, bodies, work
});

/// Work done against each load since the start, J.
#[derive(Clone, Copy, Debug)]
pub struct Work<S> {
    pub friction: S,
    pub brake: S,
    pub load: S,
    /// Lost at the stops and in the contact.
    pub impact: S,
    /// Heat of the motor's iron.
    pub iron: S,
}

kept!(Work<f64> as Work { friction, brake, load, impact, iron });

impl<S: Scalar> Shaft<S> {
    pub(super) fn derive<F: Form>(raw: &[S], d: &ShaftDetails, dt: S) -> Self {
        let view = Raw(raw);
        let at = |i: usize| raw[i];
        let screw = F::screw(raw);
        let gear = Gear::derive(F::ratio(raw), view.gear(), view.stop(), view.load(), [screw.efficiency, screw.efficiency_aiding]);
        let output_inertia = at(LoadParameter::Inertia.at());
        let reflected = output_inertia * gear.per_ratio * gear.per_ratio;
        let unbalance = Unbalance::derive(view.unbalance());
        let rotor = at(MotorParameter::Inertia.at()) + at(GearParameter::Inertia.at());
        let mut rotor = rotor + F::screw_inertia(raw) + unbalance.inertia;
        let gear_train = F::train(raw, d.gear);
        let mut backlash = Backlash::derive(view.backlash());
        if d.gear.bodies() {
            backlash.half = S::splat(0.5) * gear_train.lost_motion;
            if !d.meshed {
                rotor = rotor + gear_train.reflected;
            }
        }
        let compliance = if d.gear.bodies() { gear_train.compliance } else { S::one() / backlash.stiffness };
        let inertia = if d.elastic { rotor } else { rotor + reflected };
        let mut friction = Friction::derive(view.friction());
        friction.lubricated(screw.viscous);
        Self {
            dt,
            friction,
            grease: Grease::derive(view.lubricant()),
            gear,
            backlash,
            compliance,
            gear_train,
            screw,
            train: Train::derive(raw, unbalance.eccentricity(rotor + reflected)),
            stick: Friction::stick(view.friction()),
            nut: F::nut(raw, network_period(raw, dt.lane(0))),
            vibration: F::housing(raw),
            unbalance,
            inertia,
            rotor_inertia: rotor,
            whole_inertia: rotor + reflected,
            dt_per_inertia: dt / inertia,
            dt_per_rotor: dt / rotor,
            output_inertia: if d.elastic || d.flanks { output_inertia } else { S::zero() },
            per_output_inertia: S::one() / S::select(S::zero().lt(output_inertia), output_inertia, S::one()),
            load_friction: at(LoadParameter::Friction.at()),
            load_damping: at(LoadParameter::Damping.at()),
        }
    }

    /// At rest or moving as given; NaN where nothing is given.
    /// From positions and speeds; NaN where not given. An output's position alone takes the motor with it, mid-backlash.
    pub(super) fn start(&self, motor: [S; 2], output: [S; 2]) -> ShaftState<S> {
        let or = |given: S, other: S| S::select(given.equals(given), given, other);
        let zero = S::zero();
        let motor_position = or(motor[0], or(output[0] * self.gear.ratio, zero));
        let driver = motor_position * self.gear.per_ratio;
        let output_position = self.backlash.follow(driver, or(output[0], driver));
        ShaftState {
            motor_position,
            motor_speed: or(motor[1], zero),
            output_position,
            output_speed: or(output[1], zero),
            jam_side: (output_position - self.friction.jam_position).sign(),
            jammed: S::select(S::splat(0.5).le(self.friction.jam_anywhere), S::one(), zero),
            scatter: S::one(),
            fastest: zero,
            bristle: zero,
            lubricant: Lubricant::reference(),
            nut: self.nut.start(),
            vibration: VibrationState::initial(),
            flank: Flank::at(driver - output_position, self.backlash.half),
            bodies: Bodies::with(motor_position, or(motor[1], zero), self.gear_train.turns),
            work: Work { friction: zero, brake: zero, load: zero, impact: zero, iron: zero },
        }
    }
}

impl<S: Scalar> Shaft<S> {
    /// Gives the lubricant a temperature.
    pub(super) fn lubricate(&self, s: &mut ShaftState<S>, temperature: S) {
        s.lubricant = self.grease.at(temperature);
    }
}

/// Why no shaft stands so: motor and output further apart than the backlash lets them. `at` holds both positions, NaN where not
/// given.
pub(super) fn refuses_start<F: Form>(raw: &[f64], at: [f64; 2], high: bool) -> Option<String> {
    let [motor, output] = at;
    let driver = motor / F::ratio(raw);
    let apart = (output - driver).abs();
    let layout = F::layout(raw);
    if high && layout.bodies() {
        // How far each of several meshes is wound up two positions do not tell.
        return (apart > 1e-9 * driver.abs() + 1e-12).then(|| {
            format!(
                "initial: output_position = {output} and motor_position = {motor}: the output is {apart} away from where a gear of several \
                 bodies starts, amid each backlash; leave one of them out"
            )
        });
    }
    let half = if layout.bodies() { 0.5 * F::train(raw, layout).lost_motion } else { Backlash::derive(Raw(raw).backlash()).half };
    // What an elastic backlash is wound up by is for the caller to state.
    let elastic = BacklashModel::read(Raw(raw).backlash()[BacklashParameter::Model as usize]) == BacklashModel::Elastic;
    (!elastic && apart > half * (1.0 + 1e-9) + 1e-12).then(|| {
        format!(
            "initial: output_position = {output} and motor_position = {motor}: the output is {apart} away from where the motor holds it, more \
             than half the backlash, {half}; leave one of them out"
        )
    })
}

impl<S: Scalar> ShaftState<S> {
    /// The friction of a screw with debris in it, until the next tick; `noise` has unit deviation.
    pub(super) fn scatter(&mut self, screw: &Screw<S>, noise: S) {
        self.scatter = screw.scatter.fma(noise, S::one()).maximum(S::zero());
    }
}
