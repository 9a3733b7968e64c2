//! Proximity switches at 0, 25 and 75 % of the stroke and on the lock sleeve, with hysteresis and response time.

use crate::variables;

variables! {
    /// The four switches; 100 % senses the lock sleeve.
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
        Off0 => "off_0", "-", "1", Flag, Sensor, Some(0.0), "1: the switch at 0 % never reads on";
        Off25 => "off_25", "-", "1", Flag, Sensor, Some(0.0), "1: the switch at 25 % never reads on";
        Off75 => "off_75", "-", "1", Flag, Sensor, Some(0.0), "1: the switch at 75 % never reads on";
        Off100 => "off_100", "-", "1", Flag, Sensor, Some(0.0), "1: the switch on the lock sleeve never reads on";
    }
}

/// The switches of one actuator.
#[derive(Clone, Copy, Debug, Default)]
pub struct Switches {
    on: [bool; 4],
    waiting: [f64; 4],
    /// What the control unit sees: 0, 25, 75 %, lock sleeve.
    pub reading: [bool; 4],
}

fn sensed(raw: &[f64], before: &[bool; 4], ram: f64, locked: bool) -> [bool; 4] {
    use ProximityParameter as P;
    let hysteresis = raw[P::Hysteresis as usize];
    let back = |j: usize| if before[j] { hysteresis } else { 0.0 };
    [
        ram <= raw[P::Position0 as usize] + back(0),
        ram >= raw[P::Position25 as usize] - back(1),
        ram >= raw[P::Position75 as usize] - back(2),
        locked,
    ]
}

impl Switches {
    pub fn start(raw: &[f64], ram: f64, locked: bool) -> Self {
        let on = sensed(raw, &[false; 4], ram, locked);
        let mut switches = Self { on, waiting: [0.0; 4], reading: on };
        switches.read(raw);
        switches
    }

    /// After a tick of `dt`.
    pub fn step(&mut self, raw: &[f64], ram: f64, locked: bool, dt: f64) {
        let now = sensed(raw, &self.on, ram, locked);
        let delay = raw[ProximityParameter::Delay as usize] * (1.0 - 1e-9);
        for j in 0..4 {
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
        for j in 0..4 {
            let (stuck_on, stuck_off) = (raw[P::On0 as usize + j] >= 0.5, raw[P::Off0 as usize + j] >= 0.5);
            self.reading[j] = (self.on[j] || stuck_on) && !stuck_off;
        }
    }
}
