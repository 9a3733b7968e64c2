//! On the friction rig, which imposes the speed of the ram.

use super::*;

impl<S: Scalar> Mechanics<S> {
    /// The rig moves the ram; the motor follows unless the stages are apart. The ram hangs from the load cell.
    #[inline(always)]
    pub(super) fn imposed(&self, s: &mut Motion<S>, a: &Acting<S>, f: &Forces<S>) {
        let zero = S::zero();
        let half = S::splat(0.5);
        let apart = half.lt(a.released);
        let mut coasting = *s;
        self.apart(&mut coasting, a, f);
        let (old, new) = (s.nut_speed, a.rig_speed);
        let direction = new.sign();
        let rubs = self.friction.at(new, zero.le(new), s.nut_position, self.screw.turns);
        let detent = self.detent_torque(s.motor_position);
        let jam = self.screw.jam(s.nut_position);
        let torque = a.motor_torque + detent - direction * (self.brake.torque(a.brake_free) + self.bearing);
        let inertia = self.inertia_train * self.per_travel * self.per_travel;
        let connected = direction * (rubs.train + jam) - torque * self.per_travel + inertia * (new - old) / self.dt;
        let released = direction * (rubs.screw + jam) + self.governor.force(new) + self.mass_screw * (new - old) / self.dt;
        let weight = self.mass * S::splat(GRAVITY);
        s.rig_force = S::select(apart, released, connected) - weight - f.spring;
        s.nut_speed = new;
        s.fastest = s.fastest.maximum((new * self.per_travel).abs());
        s.motor_speed = S::select(apart, coasting.motor_speed, new * self.per_travel);
    }
}
