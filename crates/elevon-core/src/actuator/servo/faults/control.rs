//! Faults of the controller and of the sensors of position.

use super::Side;
use crate::fault::rate::{CONTROLLER, POSITION_SENSOR, SWITCH};
use crate::fault::{Attribute, FaultKind};
use crate::variable::Range;
use crate::{phases, places};

/// Faults of controller and position sensors.
pub fn control_and_sensors(side: Side) -> Vec<FaultKind> {
    const PERIOD: &[Attribute] =
        &[Attribute { name: "period", unit: "s", default: Some(0.1), path: "", flag: "", text: "period of the interruptions" }];
    const SECTORS: &[Attribute] = &[
        Attribute {
            default: Some(1.0),
            ..Attribute::new("sectors", "1", "sensor.encoder.dark_sectors", "number of dark sectors, equal and evenly spread")
        },
        Attribute {
            default: Some(0.0),
            ..Attribute::new("position", "rad", "sensor.encoder.dark_position", "angle of the disc at the middle of a dark sector")
        },
    ];
    const FIRST: &[Attribute] = &[Attribute {
        default: Some(0.0),
        ..Attribute::new("phase", "rad", "sensor.encoder.first_phase", "phase of the error where the output stands at zero")
    }];
    const SECOND: &[Attribute] = &[Attribute {
        default: Some(0.0),
        ..Attribute::new("phase", "rad", "sensor.encoder.second_phase", "phase of the error where the output stands at zero")
    }];
    vec![
        FaultKind {
            kind: "gain_drift",
            unit: "1",
            range: Range::Between(-1.0, 10.0),
            attributes: &[],
            places: places!("control.position": "control.position_gain_scale" Grow, "control.speed": "control.speed_gain_scale" Grow),
            effect: "relative drift of a loop gain: -0.2 means gain x 0.8",
            source: "T1 (proportional gain drift)",
            rate: CONTROLLER,
        },
        FaultKind {
            kind: "dropout",
            unit: "1",
            range: Range::Between(0.0, 1.0),
            attributes: PERIOD,
            places: places!("sensor.resolver": "sensor.resolver.power_off" Pulse),
            effect: "duty of the resolver's power lost: while off the drive sees a shaft at rest, then the position jumps back",
            source: "N 4.5",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "mismatch",
            unit: "1",
            range: Range::Between(0.0, 0.99),
            attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.mismatch" Add),
            effect: "amplitude lost by one resolver channel: atan2(g sin, cos), an angle error at twice the shaft frequency",
            source: "N 4.5",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "quadrature",
            unit: "rad",
            range: Range::Between(-0.3, 0.3),
            attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.quadrature" Add),
            effect: "angle by which the resolver's windings deviate from their right angle: an angle error of half of it, in the mean and at twice the shaft frequency",
            source: "closed form of the converter's arctangent; that it comes as a fault ASSUMED (deformed or displaced windings)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "channel_offset",
            unit: "1",
            range: Range::Between(-0.2, 0.2),
            attributes: &[],
            places: places!("sensor.resolver.sine": "sensor.resolver.sine_offset" Add, "sensor.resolver.cosine": "sensor.resolver.cosine_offset" Add),
            effect: "offset of a demodulated resolver channel over its healthy amplitude: an angle error of as many rad once a turn of the shaft",
            source: "closed form of the converter's arctangent; that it comes as a fault ASSUMED (drift of the converter's electronics)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "offset",
            unit: "rad",
            range: Range::Any,
            attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.offset" Add),
            effect: "offset of the motor's position; it misplaces the commutation where the resolver gives its angle",
            source: "T3 Table 1.1 (position sensor)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "offset",
            unit: side.coordinate,
            range: Range::Any,
            attributes: &[],
            places: places!("sensor.encoder": "sensor.encoder.offset" Add),
            effect: "offset of the reported output position; the position loop feels it where control.position_feedback = encoder",
            source: "T3 Table 1.1 (position sensor)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "gain",
            unit: "1",
            range: Range::Between(-1.0, 10.0),
            attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.gain" Grow, "sensor.encoder": "sensor.encoder.gain" Grow),
            effect: "relative gain error of a position sensor; the position loop feels the encoder's where control.position_feedback = encoder, the resolver's where it is resolver",
            source: "T3 Table 1.1 (position sensor)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "missing_counts",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.encoder": "sensor.encoder.missing_counts" Add),
            effect: "fraction of the encoder's counts lost, spread evenly: the reported displacement is too short; the position loop feels it where control.position_feedback = encoder",
            source: "N 4.5",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "dark_sectors",
            unit: "1",
            range: Range::Unit,
            attributes: SECTORS,
            places: places!("sensor.encoder": "sensor.encoder.dark_share" Add),
            effect: "share of the encoder's disc that gives no counts: the reported position stands in a dark sector, and what was lost stays lost until the disc turns back through it or the drive is referenced anew; the position loop feels it where control.position_feedback = encoder",
            source: "N 4.5 (sectors of the disc)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "interpolation",
            unit: "1",
            range: Range::Between(0.0, 0.5),
            attributes: FIRST,
            places: places!("sensor.encoder.first": "sensor.encoder.first_harmonic" Add),
            effect: "interpolation error once a period of the encoder's pulses, over that period (offsets of its signals); the position loop feels it where control.position_feedback = encoder",
            source: "closed form of two signals with offsets; that it comes as a fault ASSUMED (dirt, drift of the electronics)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "interpolation",
            unit: "1",
            range: Range::Between(0.0, 0.5),
            attributes: SECOND,
            places: places!("sensor.encoder.second": "sensor.encoder.second_harmonic" Add),
            effect: "interpolation error twice a period of the encoder's pulses, over that period (unequal amplitudes or a phase error of its signals); the position loop feels it where control.position_feedback = encoder",
            source: "closed form of two unlike signals; that it comes as a fault ASSUMED (tilt or distance of the reading head)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "resolver_short",
            unit: "1",
            range: Range::Between(0.0, 0.99),
            attributes: &[],
            places: places!(
                "sensor.resolver.sine": "sensor.resolver.sine_short" Add, "sensor.resolver.cosine": "sensor.resolver.cosine_short" Add,
                "sensor.resolver.excitation": "sensor.resolver.excitation_short" Add,
            ),
            effect: "fraction of a resolver winding's turns shorted: a secondary one falsifies the angle twice a turn, the excitation turns no angle until less than sensor.resolver.least_signal is left, then the drive sees a shaft at rest",
            source: "N 4.5 (windings of the resolver; amplitude alone, no phase shift: ASSUMED)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "resolver_open",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.resolver.sine": "sensor.resolver.sine_open" Set, "sensor.resolver.cosine": "sensor.resolver.cosine_open" Set),
            effect: "1: the winding is interrupted; with one channel dead the reported angle leaps by half a turn",
            source: "N 4.5 (windings of the resolver)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "resolver_open",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.resolver.excitation": "sensor.resolver.power_off" Set),
            effect: "1: the winding is interrupted; without excitation the shaft seems to rest",
            source: "N 4.5 (windings of the resolver)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "stuck",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.resolver": "sensor.resolver.stuck" Set, "sensor.encoder": "sensor.encoder.stuck" Set),
            effect: "1: the reading stands still at its value of the onset, afterwards it is the true one again; of the encoder the position loop feels it where control.position_feedback = encoder",
            source: "T3 Table 1.1 (position sensor)",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "stuck",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: phases!("sensor.current_": "sensor.current.stuck_" Set),
            effect: "1: the current sensor stands still at its value of the onset: its leg controls nothing; between relays the other two legs leave its phase what the star allows, a carrier drive controls a wrong current",
            source: "ASSUMED: the usual failure of a sensor's electronics, in addition to gain and offset of T2",
            rate: SWITCH,
        },
        FaultKind {
            kind: "dead",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: places!("sensor.encoder": "sensor.encoder.dead" Set),
            effect: "1: no counts come: the reported position stands still, and what was lost stays lost until the drive is referenced anew; the position loop feels it where control.position_feedback = encoder",
            source: "N 4.5",
            rate: POSITION_SENSOR,
        },
        FaultKind {
            kind: "dead",
            unit: "1",
            range: Range::Unit,
            attributes: &[],
            places: phases!("sensor.current_": "sensor.current.dead_" Set),
            effect: "1: the current sensor reports zero: its leg controls nothing; between relays the other two legs leave its phase what the star allows, a carrier drive controls a wrong current",
            source: "ASSUMED: broken wire, in addition to gain and offset of T2",
            rate: SWITCH,
        },
    ]
}
