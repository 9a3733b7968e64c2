//! Proximity switches at 0, 25 and 75 % of the stroke, on the lock sleeve and on the wheels' strut, with hysteresis and
//! response time.

use crate::kept;
use crate::variables;

variables! {
    /// The switches; 100 % senses the lock sleeve.
    ProximityParameter, PROXIMITY {
        Position0 => "position_0", "-", "m", Positive, Sensor, None, "ram position below which the switch at 0 % is on";
        Position25 => "position_25", "-", "m", Positive, Sensor, None, "ram position from which the switch at 25 % is on";
        Position75 => "position_75", "-", "m", Positive, Sensor, None, "ram position from which the switch at 75 % is on";
        Hysteresis => "hysteresis", "-", "m", NonNegative, Sensor, None, "travel back before a switch lets go";
        Delay => "delay", "-", "s", NonNegative, Sensor, None, "response time";
        On0 => "on_0", "-", "1", Flag, Sensor, Some(0.0), "1: the switch at 0 % always reads on";
        On25 => "on_25", "-", "1", Flag, Sensor, Some(0.0), "1: the switch at 25 % always reads on";
        On75 => "on_75", "-", "1", Flag, Sensor, Some(0.0), "1: the switch at 75 % always reads on";
        On100 => "on_100", "-", "1", Flag, Sensor, Some(0.0), "1: the switch on the lock sleeve always reads on";
        OnWheels => "on_wheels", "-", "1", Flag, Sensor, Some(0.0), "1: the weight-on-wheels switch always reads on";
        Off0 => "off_0", "-", "1", Flag, Sensor, Some(0.0), "1: the switch at 0 % never reads on";
        Off25 => "off_25", "-", "1", Flag, Sensor, Some(0.0), "1: the switch at 25 % never reads on";
        Off75 => "off_75", "-", "1", Flag, Sensor, Some(0.0), "1: the switch at 75 % never reads on";
        Off100 => "off_100", "-", "1", Flag, Sensor, Some(0.0), "1: the switch on the lock sleeve never reads on";
        OffWheels => "off_wheels", "-", "1", Flag, Sensor, Some(0.0), "1: the weight-on-wheels switch never reads on";
    }
}

/// The switches of one actuator.
#[derive(Clone, Copy, Debug, Default)]
pub struct Switches {
    on: [bool; COUNT],
    waiting: [f64; COUNT],
    /// What the control unit sees: 0, 25, 75 %, lock sleeve, weight on wheels.
    pub reading: [bool; COUNT],
}

kept!(Switches as Switches { on, waiting, reading });

pub const COUNT: usize = 5;

/// What the switches stand before.
#[derive(Clone, Copy, Debug)]
pub struct Scene {
    pub ram: f64,
    pub locked: bool,
    pub wheels: bool,
}

fn sensed(raw: &[f64], before: &[bool; COUNT], scene: Scene) -> [bool; COUNT] {
    use ProximityParameter as P;
    let hysteresis = raw[P::Hysteresis as usize];
    let back = |j: usize| if before[j] { hysteresis } else { 0.0 };
    [
        scene.ram <= raw[P::Position0 as usize] + back(0),
        scene.ram >= raw[P::Position25 as usize] - back(1),
        scene.ram >= raw[P::Position75 as usize] - back(2),
        scene.locked,
        scene.wheels,
    ]
}

impl Switches {
    pub fn start(raw: &[f64], scene: Scene) -> Self {
        let on = sensed(raw, &[false; COUNT], scene);
        let mut switches = Self { on, waiting: [0.0; COUNT], reading: on };
        switches.read(raw);
        switches
    }

    /// After a tick of `dt`.
    pub fn step(&mut self, raw: &[f64], scene: Scene, dt: f64) {
        let now = sensed(raw, &self.on, scene);
        let delay = raw[ProximityParameter::Delay as usize] * (1.0 - 1e-9);
        for j in 0..COUNT {
            self.waiting[j] = if now[j] == self.on[j] { 0.0 } else { self.waiting[j] + dt };
            if now[j] != self.on[j] && self.waiting[j] > delay {
                self.on[j] = now[j];
                self.waiting[j] = 0.0;
            }
        }
        self.read(raw);
    }

    fn read(&mut self, raw: &[f64]) {
        use ProximityParameter as P;
        for j in 0..COUNT {
            let (stuck_on, stuck_off) = (raw[P::On0 as usize + j] >= 0.5, raw[P::Off0 as usize + j] >= 0.5);
            self.reading[j] = (self.on[j] || stuck_on) && !stuck_off;
        }
    }
}
