//! After the free-fall release: two shafts.

use super::*;

impl<S: Scalar> Mechanics<S> {
    /// Motor with the first stage, and screw with ram and leg, each for itself.
    #[inline(always)]
    pub(super) fn apart(&self, s: &mut Motion<S>, a: &Acting<S>, f: &Forces<S>) {
        let zero = S::zero();
        let never = S::mask(false);
        let detent = self.detent_torque(s.motor_position);
        let brake = self.brake.torque(a.brake_free);
        let pushed = a.motor_torque + detent;
        let heading = S::select(s.motor_speed.equals(zero), pushed, s.motor_speed);
        let friction = self.friction.at(s.motor_speed * self.travel, zero.le(heading), s.nut_position, self.screw.turns);
        let rubbing = self.travel * (friction.train - friction.screw).maximum(zero);
        let other = brake + self.bearing;
        let motor = Shaft {
            speed: s.motor_speed,
            active: pushed,
            fixed: self.friction.breakaway * rubbing + other,
            kinetic: rubbing + other,
            inertia: self.inertia_motor,
            blocked_up: never,
            blocked_down: never,
        };
        let turned = self.move_shaft(&motor);

        let v = s.nut_speed;
        let axial = f.load + f.spring;
        let heading = S::select(v.equals(zero), axial, v);
        let resistance = self.friction.at(v, zero.le(heading), s.nut_position, self.screw.turns).screw;
        let loss = RollerScrew::load_friction(axial, f.efficiency * self.gear.efficiency_second);
        let jam = self.screw.jam(s.nut_position);
        let governor = self.governor.force(v);
        let (up, down) = self.ends(s);
        let rate = self.rate_term * s.carrying * self.leg * f.arm.rate * v * v;
        let ram = Shaft {
            speed: v,
            active: axial - governor - rate,
            fixed: self.friction.breakaway * resistance + loss + jam,
            kinetic: resistance + loss + jam,
            inertia: self.mass_released(s, &f.arm),
            blocked_up: up,
            blocked_down: down,
        };
        let fallen = self.move_shaft(&ram);
        s.motor_speed = turned.speed;
        s.nut_speed = fallen.speed;
        s.fastest = s.fastest.maximum(turned.free.abs()).maximum((fallen.free * self.per_travel).abs());
        let tiny = S::splat(1e-300);
        let (share, share_ram) = (turned.rubbed / motor.kinetic.maximum(tiny), fallen.rubbed / ram.kinetic.maximum(tiny));
        let (work, work_ram) = (self.dt * turned.middle, self.dt * fallen.middle);
        let e = &mut s.energy;
        e[E_MOTOR] = e[E_MOTOR] + a.motor_torque * work;
        e[E_LOAD] = e[E_LOAD] - f.load * work_ram;
        e[E_LOCK] = e[E_LOCK] - f.spring * work_ram;
        e[E_DETENT] = e[E_DETENT] - detent * work;
        e[E_FRICTION] = e[E_FRICTION] + share * (rubbing + self.bearing) + share_ram * (resistance + jam);
        e[E_EFFICIENCY] = e[E_EFFICIENCY] + share_ram * loss;
        e[E_BRAKE] = e[E_BRAKE] + share * brake;
        e[E_GOVERNOR] = e[E_GOVERNOR] + governor * work_ram;
        e[E_IMPACT] = e[E_IMPACT] + (turned.impact + fallen.impact);
    }
}
