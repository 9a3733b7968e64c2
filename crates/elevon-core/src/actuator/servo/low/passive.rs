//! The low fidelity without gates: a bridge that has tripped, lost its feedback or is off leaves diodes and shorted
//! switches on the three windings, which carry what the EMFs drive. The current of one phase cannot stand for that: the
//! windings are stepped one by one through the high fidelity's bridge, exactly for voltages held over the step.

use super::model::{Model, State, Structure};
use super::phase::Phase;
use crate::inverter::bridge::{quench, Windings};
use crate::scalar::Scalar;
use crate::three;

/// Phase currents after a step behind the bridge without gates, and the rails that they come from.
#[inline(always)]
pub(super) fn passive_step<S: Scalar>(
    m: &Model<S>,
    structure: &Structure,
    supply: S,
    s: &mut State<S>,
    p: &Phase<S>,
    i: [S; 3],
) -> ([S; 3], [S; 3]) {
    let speed = s.shaft.motor_speed;
    let half_supply = S::splat(0.5) * supply;
    let emf: [S; 3] = three!(|j| p.coefficients[j] * speed);
    let resistance: [S; 3] = three!(|j| m.resistance[j] * s.resistance_factor);
    let w = Windings { current: i, emf, per_inductance: m.drive.per_winding, resistance, open: m.star.open };
    let open = [S::zero(); 3];
    let connection = m.drive.bridge.connect(&mut s.bridge, &structure.bridge, open, open, half_supply, &w, m.dt);
    let legs = connection.legs;
    let drop: [S; 3] = three!(|j| legs.voltage[j] - emf[j] - resistance[j] * i[j]);
    let neutral = match connection.loose {
        Some(neutral) => neutral,
        None => {
            let g = m.drive.per_winding;
            (g[0] * drop[0] + g[1] * drop[1] + g[2] * drop[2]) / (g[0] + g[1] + g[2])
        }
    };
    let next = three!(|j| i[j] + m.drive.per_winding[j] * (drop[j] - neutral));
    (quench(&legs, i, next), legs.rail)
}
