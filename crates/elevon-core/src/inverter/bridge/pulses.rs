//! The bridge behind a carrier: what each leg shows in the mean of a step with its edges within it.

use super::{Bridge, BridgeState, BridgeStructure, Circuit, Connection, Legs};
use crate::inverter::carrier::{Conduction, Pulse};
use crate::scalar::Scalar;
use crate::three;

/// Shares of a step nearer to the whole step are the whole step.
const WHOLE: f64 = 1.0 - 1e-6;

/// Commands over a step.
#[derive(Clone, Copy)]
pub struct Pulses<'a, S: Scalar> {
    pub legs: &'a [Pulse<S>; 3],
    /// Commands at the end of the last step.
    pub before: [S; 3],
    /// The drive has no say.
    pub lost: S::Mask,
}

impl<S: Scalar> Bridge<S> {
    /// As `connect`, with the edges of a carrier within the step: voltages and rails are means over it, in which diodes
    /// hold a leg for the part that both its switches are open.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    pub fn connect_pulses(
        &self,
        s: &mut BridgeState<S>,
        structure: &BridgeStructure,
        pulses: &Pulses<'_, S>,
        half_supply: S,
        w: &impl Circuit<S>,
        dt: S,
    ) -> Connection<S> {
        let current = w.currents();
        let mut closed = self.closed(s, pulses, current, dt);
        if structure.switch_faults {
            closed = three!(|j| self.broken_switches(j, closed[j]));
        }
        if structure.trips {
            for j in 0..3 {
                let both = S::splat(2.0 - WHOLE).lt(closed[j].upper + closed[j].lower);
                self.watch(s, both, current[j]);
            }
        }
        let mut legs = self.means(&closed, half_supply, current);
        let all_held = !S::any(legs.passive[0] | legs.passive[1] | legs.passive[2]);
        if all_held && !structure.open_phases {
            return Connection { legs, loose: None };
        }
        let neutral = self.release(&mut legs, half_supply, w);
        Connection { legs, loose: Some(neutral) }
    }

    /// Shares of the step in which the switches are closed. A leg without current has no diode to follow and is given to
    /// its switches at once.
    #[inline(always)]
    fn closed(&self, s: &mut BridgeState<S>, pulses: &Pulses<'_, S>, current: [S; 3], dt: S) -> [Conduction<S>; 3] {
        let (zero, one) = (S::zero(), S::one());
        let dead = self.dead_time / dt;
        let off = pulses.lost | S::splat(0.5).lt(s.tripped);
        let mut left = [zero; 3];
        let closed = three!(|j| {
            let (conduction, after) = pulses.legs[j].conduction(pulses.before[j], s.blanking[j], dead);
            left[j] = after;
            let share = pulses.legs[j].share;
            let idle = current[j].equals(zero);
            let upper = S::select(idle, share, conduction.upper);
            let lower = S::select(idle, one - share, conduction.lower);
            Conduction { upper: S::select(off, zero, upper), lower: S::select(off, zero, lower) }
        });
        s.blanking = left;
        closed
    }

    /// Some switches stay open or closed.
    #[inline(always)]
    fn broken_switches(&self, leg: usize, closed: Conduction<S>) -> Conduction<S> {
        let half = S::splat(0.5);
        let stuck = |share: S, i: usize| {
            let works = S::select(half.le(self.open[leg][i]), S::zero(), share);
            S::select(half.le(self.shorted[leg][i]), S::one(), works)
        };
        Conduction { upper: stuck(closed.upper, 0), lower: stuck(closed.lower, 1) }
    }

    /// Legs in the mean of the step; one whose switches are open all the time is passive.
    #[inline(always)]
    fn means(&self, closed: &[Conduction<S>; 3], half_supply: S, current: [S; 3]) -> Legs<S> {
        let (zero, one) = (S::zero(), S::one());
        // A shot-through leg stands at the upper rail.
        let lower: [S; 3] = three!(|j| closed[j].lower.minimum(one - closed[j].upper));
        let open: [S; 3] = three!(|j| (one - closed[j].upper - lower[j]).maximum(zero));
        // Its diodes follow the current; without one it floats, not far from the middle of the link.
        let side: [S; 3] = three!(|j| -current[j].sign() * open[j]);
        let rail: [S; 3] = three!(|j| half_supply * (closed[j].upper - lower[j] + side[j]));
        Legs {
            voltage: three!(|j| {
                let drop = (-self.on_resistance * (one - open[j])).fma(current[j], rail[j]);
                self.diode_drop.fma(side[j], drop)
            }),
            rail,
            connected: [S::mask(true); 3],
            passive: three!(|j| S::splat(WHOLE).lt(open[j])),
        }
    }
}
