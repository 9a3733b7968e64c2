//! How often parts fail: the rate of each line of the catalogue.

/// Failures an hour at one place, and where the number is from. The rate of a part stands for each of its kinds: an upper
/// bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    pub per_hour: f64,
    pub source: &'static str,
}

pub const BEARINGS: Rate = Rate { per_hour: 1.78e-5, source: "T3 Table 1.1 (bearings)" };
pub const POSITION_SENSOR: Rate = Rate { per_hour: 1.70e-5, source: "T3 Table 1.1 (position sensor)" };
pub const MOTOR: Rate = Rate { per_hour: 1.03e-5, source: "T3 Table 1.1 (brushless motor)" };
pub const CONNECTOR: Rate = Rate { per_hour: 6.64e-7, source: "T3 Table 1.1 (power connector)" };
/// A switch of the bridge, a proximity switch with its wiring, a current sensor.
pub const SWITCH: Rate = Rate { per_hour: 2e-6, source: "ASSUMED: the order of a power semiconductor or a sealed sensor in flight" };
pub const CONTROLLER: Rate = Rate { per_hour: 2e-6, source: "ASSUMED: as a switch; a loop gain drifts by its electronics" };
/// Gears, screw, brake, lock, release cable.
pub const MECHANISM: Rate = Rate { per_hour: 1e-6, source: "ASSUMED: a tenth of the motor's" };
