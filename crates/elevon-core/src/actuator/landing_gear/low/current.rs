//! Mean currents of a carrier period: the pair's, continuous or not, the third phase's, and of shorted windings
//! (docs/explanation/theory/landing-gear.md).

use super::super::body::Body;
use super::pair::Pair;
use super::{Model, State};
use crate::inverter::six_step::Chopping;
use crate::scalar::Scalar;

/// Fundamental of a trapezoid with flats of 120 degrees over its top: (4/pi) sin(30 deg)/(pi/6).
const FUNDAMENTAL: f64 = 1.215_854_203_708_053_3;

/// What the pair sees while the carrier is above the demand, against the current: with low-side chopping one diode, else the
/// link and two of them.
#[inline(always)]
fn against<S: Scalar>(m: &Model<S>, chopping: Chopping, link: S) -> S {
    match chopping {
        Chopping::LowSide => m.diode_drop,
        Chopping::Both => link + m.diode_drop + m.diode_drop,
    }
}

/// The pair's L di/dt = V - R i over a step, the commutations a part of R: share of the approach to V/R.
#[derive(Clone, Copy)]
pub(super) struct Lag<S> {
    pub(super) share: S,
    pub(super) from: S,
}

impl<S: Scalar> Lag<S> {
    #[inline(always)]
    pub(super) fn to(&self, settled: S) -> S {
        self.share.fma(settled - self.from, self.from)
    }
}

/// Most carrier periods that are followed from cut to cut.
const LONGEST: usize = 512;

/// Mean current of a pair whose peaks the cut-off ends. In each carrier period the current rises while the pair is on. Where it reaches
/// the cut-off, all switches open, and two diodes bring it down against the link until the next period; where the demand ends the rise
/// before, it falls against `off`. With a duty below one there are many periods without a cut: the mean is that from one to the next.
#[inline(always)]
fn cut_off<S: Scalar>(m: &Model<S>, [link, along, off]: [S; 3], [resistance, inductance]: [S; 2], duty: S) -> S {
    let (zero, half, one, two) = (S::zero(), S::splat(0.5), S::one(), S::splat(2.0));
    let peak = m.c.cutoff;
    let per_volt = m.c.modulator.period / inductance;
    let open = link + m.diode_drop + m.diode_drop;
    let (mut current, mut sum, mut periods, mut cuts) = (peak, zero, zero, zero);
    for _ in 0..LONGEST {
        let rise = (per_volt * (link - along - resistance * current)).maximum(S::splat(1e-12));
        let cut = peak.le(rise.fma(duty, current));
        let on = S::select(cut, (peak - current).maximum(zero) / rise, duty);
        let top = rise.fma(on, current);
        let fall = per_volt * (S::select(cut, open, off) + along + resistance * top);
        let rest = (one - on).minimum(top / S::select(zero.lt(fall), fall, one));
        let lasts = S::select(zero.lt(fall), rest, one - on);
        let bottom = (top - fall * lasts).maximum(zero);
        // The first cut only sets the phase of the second.
        let counted = S::indicator(cuts.equals(two));
        sum = (counted * half).fma((current + top) * on + (top + bottom) * lasts, sum);
        periods = periods + counted;
        cuts = cuts + S::indicator(cut);
        current = bottom;
        if !S::any(cuts.le(two)) {
            break;
        }
    }
    S::select(zero.lt(periods), sum / periods.maximum(one), peak)
}

/// Mean current over a carrier period after a step (`docs/explanation/theory/landing-gear.md`). The continuous current lags, and decays
/// towards what its circuit drives back; the pulses, which start from none in each period, do not.
#[inline(always)]
pub(super) fn mean_current<S: Scalar>(m: &Model<S>, chopping: Chopping, p: &Pair<S>, body: &State<S>, duty: S) -> S {
    let (zero, half, one) = (S::zero(), S::splat(0.5), S::one());
    let s = &body.body;
    let speed = s.motion.motor_speed;
    let emf = p.constant * speed;
    let link = s.link;
    let inductance = S::select(zero.lt(p.inductance), p.inductance, one);
    let resistance = S::select(zero.lt(p.resistance), p.resistance, one) + m.commutation * speed.abs() * (S::splat(0.5) * inductance);
    // The diodes rectify an EMF above the link, which no switch can cut off.
    let excess = (emf.abs() - (link + m.diode_drop + m.diode_drop)).maximum(zero);
    let passive = -(emf.signed(excess) / resistance);
    let sign = s.demand.signed(one);
    let along = sign * emf;
    let share = (m.c.dt * resistance / inductance).minimum(one);
    let lag = Lag { share, from: sign * body.current };
    let off = against(m, chopping, link);
    let (rise, fall) = (link - along, off + along);
    let usable = zero.lt(rise) & zero.lt(fall);
    let safe_fall = S::select(usable, fall, one);
    let safe_rise = S::select(usable, rise, zero);
    let boundary = safe_fall / (safe_rise + safe_fall);
    let gap = duty.minimum(boundary);
    let pulsed = S::splat(0.5) * gap * gap * m.c.modulator.period / inductance * safe_rise * (one + safe_rise / safe_fall);
    let continuous = (duty * link - (one - duty) * off - along) / resistance;
    let plugging = match chopping {
        // The EMF drives its current on through the HIGH leg.
        Chopping::LowSide => continuous,
        Chopping::Both => (duty * link - along) / resistance,
    };
    // An EMF above the link drives a current back through the closed switches.
    let back = duty * rise / resistance;
    let forced = S::select(zero.lt(duty), S::select(rise.le(zero), back, plugging), zero);
    let settled = S::select(usable, pulsed.maximum(continuous), forced);
    let reached = S::select(usable, pulsed.maximum(lag.to(continuous)), lag.to(forced));
    let ripple = half * duty * (one - duty) * m.c.modulator.period / inductance * (safe_rise + safe_fall);
    let cuts = m.c.cutoff.lt(settled + ripple);
    let mut limit = m.c.cutoff;
    if S::any(cuts) {
        limit = S::select(cuts, cut_off(m, [link, along, off], [resistance, inductance], duty), limit);
    }
    let cut = settled.clamp_abs(limit) * sign;
    let braking = passive.signed(passive.abs().maximum((cut * passive.sign()).maximum(zero)));
    let rectified = S::select(zero.lt(cut * passive), braking, cut + passive);
    let rectified = share.fma(rectified - body.current, body.current);
    S::select(passive.equals(zero), reached.clamp_abs(limit) * sign, rectified) * p.closed
}

/// Share of a carrier period in which the pair, switched off, still carries current (low-side chopping): its pulse falls to
/// none before the next, or the EMF drives it on.
#[inline(always)]
fn freewheels<S: Scalar>(m: &Model<S>, p: &Pair<S>, s: &Body<S>, duty: S) -> S {
    let (zero, one) = (S::zero(), S::one());
    let along = s.demand.signed(one) * p.constant * s.motion.motor_speed;
    let (rise, fall) = ((s.link - along).maximum(zero), m.diode_drop + along);
    let off = one - duty;
    let lasts = (duty * rise / S::select(zero.lt(fall), fall, one)).minimum(off);
    S::select(zero.lt(fall), lasts, off)
}

/// Mean currents of the phase that is not used: shared with the pair, and alone with the HIGH leg.
pub(super) struct Third<S> {
    pub(super) shared: S,
    pub(super) alone: S,
}

/// With low-side chopping the pair lies at the upper rail while it freewheels; an EMF above the pair's by half a diode then
/// drives a current through the third phase's diode, x = e_3 - (e_1 + e_2)/2 - V_f/2 over 3/2 L. Once the pair's own has ended
/// the HIGH leg is left, e_3 - e_1 - V_f over 2 L; while the pair is on it falls by (V + V_f)/2 - x over 3/2 L.
#[inline(always)]
pub(super) fn third_current<S: Scalar>(m: &Model<S>, p: &Pair<S>, s: &Body<S>, duty: S) -> Third<S> {
    let (zero, half, one) = (S::zero(), S::splat(0.5), S::one());
    let inductance = S::select(zero.lt(p.inductance), p.inductance, one);
    let per_volt = m.c.modulator.period / inductance;
    let speed = s.motion.motor_speed;
    let excess = (p.emf_shared * speed - half * m.diode_drop).maximum(zero);
    let against = (half * (s.link + m.diode_drop) - excess).maximum(S::splat(1e-3) * s.link.maximum(one));
    let rise = S::splat(4.0 / 3.0) * per_volt * excess;
    let fall = S::splat(4.0 / 3.0) * per_volt * against;
    let drift = per_volt * (p.emf_alone * speed - m.diode_drop);
    let off = freewheels(m, p, s, duty);
    let floats = (one - duty - off).maximum(zero);
    let peak = rise * off;
    let dies = drift.lt(zero);
    let lasts = S::select(dies, (peak / S::select(dies, -drift, one)).minimum(floats), floats);
    let last = (peak + drift * lasts).maximum(zero);
    let falls = (last / fall).minimum(duty);
    let conducts = p.closed * S::indicator(zero.lt(duty));
    Third { shared: conducts * (half * peak * off + falls * (last - half * fall * falls)), alone: conducts * half * (peak + last) * lasts }
}

/// Windings shorted by the low switches.
pub(super) struct Shorted<S: Scalar> {
    /// Line current that gives their mean torque.
    pub(super) line: S,
    /// The cut-off opens the switches again and again.
    pub(super) chopped: S::Mask,
}

/// Mean torque of the windings shorted by the low switches: 3/2 k_1^2 w R/(R^2 + (p w L)^2) with the fundamental k_1 of the
/// EMF, up to the current cut-off.
#[inline(always)]
pub(super) fn shorted_current<S: Scalar>(m: &Model<S>, p: &Pair<S>, s: &Body<S>) -> Shorted<S> {
    let (half, one) = (S::splat(0.5), S::one());
    let constant = S::select(p.constant.equals(S::zero()), one, p.constant);
    let fundamental = S::splat(FUNDAMENTAL * 0.5) * constant;
    let resistance = half * p.resistance;
    let speed = s.motion.motor_speed;
    let reactance = m.c.star.pole_pairs * speed * (half * p.inductance);
    let impedance = resistance * resistance + reactance * reactance;
    let torque = S::splat(1.5) * fundamental * fundamental * speed * resistance / impedance;
    // No cut-off opens a short across the terminals.
    let limit = S::select(half.lt(m.terminals), S::splat(1e9), m.c.cutoff);
    let line = torque / constant;
    // The cut-off looks at the phase currents, whose amplitude is more than what brakes of them.
    let amplitude = (fundamental * speed).abs() / impedance.sqrt();
    Shorted { line: -line.clamp_abs(limit), chopped: limit.lt(amplitude) }
}

/// Where the power that shorted windings brake goes: their copper, switches and diodes, and the link.
pub(super) struct Braked<S> {
    pub(super) copper: S,
    pub(super) drops: S,
    pub(super) drawn: S,
}

/// Below the cut-off all of it becomes heat in the windings' own circuit. Beyond, the windings are a boost converter: a current
/// held at the cut-off heats its circuit by 2 R i^2, and the rest flows through two diodes to the link while all switches are off.
#[inline(always)]
pub(super) fn braked_power<S: Scalar>(m: &Model<S>, p: &Pair<S>, s: &State<S>, chopped: S::Mask) -> Braked<S> {
    let (zero, one) = (S::zero(), S::one());
    let power = -(p.constant * s.body.motion.motor_speed * s.current);
    let heat = S::select(chopped, (p.resistance * s.current * s.current).minimum(power), power);
    let diodes = m.diode_drop + m.diode_drop;
    let returned = power - heat;
    let lost = returned * diodes / (s.body.link + diodes).maximum(one);
    let share = p.winding / S::select(zero.lt(p.resistance), p.resistance, one);
    Braked { copper: heat * share, drops: heat * (one - share) + lost, drawn: lost - returned }
}
