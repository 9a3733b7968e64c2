/* Plant and drive of a foreign linear actuator: a direct-current motor, a gearbox and a screw, closed on the position.
 * Written apart from the package, for its tests: LuGre friction that grows with the force through the screw and differs
 * between the directions, a sampled PID (or cascade) with a delay, counts, a current limit and the supply's voltage. */
#include <math.h>

/* Every field is a double: the caller reads their names and order from this text. */
struct linear {
    double steps;              /* of the integration */
    double dt;                 /* s */
    double control_every;      /* steps between two samples of the drive */
    double log_every;          /* steps between two rows of the log */
    double per_metre;          /* motor rad per metre */
    double torque_constant;    /* N m/A and V s/rad */
    double inertia;            /* kg m2, motor, gearbox and screw on the motor's shaft */
    double mass;               /* kg */
    double weight;             /* N, against extension */
    double dry;                /* N m, moving, extending */
    double stick;              /* share by which rest holds more */
    double reverse;            /* dry friction retracting over extending */
    double stribeck;           /* rad/s */
    double viscous;            /* N m s/rad */
    double bending;            /* (s/rad): viscous torque C w (1 - bending |w|) */
    double per_load;           /* friction per load torque */
    double bristle;            /* N m/rad */
    double bristle_damping;    /* N m s/rad */
    double ripple;             /* share of the dry friction that the screw's turns modulate */
    double ripple_pitch;       /* m */
    double resistance;         /* ohm */
    double inductance;         /* H */
    double supply;             /* V */
    double current_gain;       /* V/A of the current loop */
    double current_limit;      /* A */
    double cascade;            /* 0: PID to the current; 1: P and PI */
    double gain;               /* A/m, or 1/s of the position loop */
    double integral;           /* A/(m s), or A/rad of the speed loop */
    double derivative;         /* A s/m, or A s/rad of the speed loop */
    double filter;             /* s, of derivative or speed */
    double speed_limit;        /* rad/s of the cascade's speed set point */
    double count;              /* m */
    double delay;              /* samples of the drive between reading and acting */
    double start;              /* m */
    double stiffness;          /* N/m between screw and mass; 0: rigid */
    double joint_damping;      /* N s/m there */
};

enum { POSITION, SPEED, CURRENT, VOLTAGE, COLUMNS };
enum { LONGEST = 64 };

static double clip(double x, double limit)
{
    return x > limit ? limit : x < -limit ? -limit : x;
}

static double counted(double x, double count)
{
    return count > 0.0 ? count * floor(x / count + 0.5) : x;
}

int run(const struct linear *b, const double *command, double *rows)
{
    const int elastic = b->stiffness > 0.0;
    const double inertia = b->inertia + (elastic ? 0.0 : b->mass / (b->per_metre * b->per_metre));
    double place = b->start, pace = 0.0; /* of an elastic mass */
    const long steps = (long)b->steps, every = (long)b->control_every, log_every = (long)b->log_every;
    const double tick = b->control_every * b->dt;
    double angle = b->start * b->per_metre, speed = 0.0, bristle = 0.0, current = 0.0, voltage = 0.0;
    double sum = 0.0, last = 0.0, slope = 0.0, before = 0.0, asked[LONGEST] = {0.0};
    const double load = b->weight / b->per_metre;
    long tick_number = 0, late = (long)b->delay;
    for (long k = 0; k < steps; k++) {
        if (k % every == 0) {
            double shown = counted(elastic ? place : angle / b->per_metre, b->count), error = command[tick_number] - shown, wanted;
            double share = b->filter > 0.0 ? tick / (b->filter + tick) : 1.0;
            if (b->cascade > 0.5) {
                double measured = (shown - (tick_number ? before : shown)) / tick * b->per_metre;
                slope += share * (measured - slope);
                double off = clip(b->gain * b->per_metre * error, b->speed_limit) - slope;
                wanted = b->derivative * off + sum;
                if (fabs(wanted) < b->current_limit) sum += b->integral * off * tick;
                before = shown;
            } else {
                double rate = tick_number ? (error - last) / tick : 0.0;
                slope += share * (rate - slope);
                wanted = b->gain * error + sum + b->derivative * slope;
                if (fabs(wanted) < b->current_limit) sum += b->integral * error * tick;
                last = error;
            }
            asked[tick_number % LONGEST] = clip(wanted, b->current_limit);
            tick_number++;
        }
        double reference = tick_number > late ? asked[(tick_number - 1 - late) % LONGEST] : 0.0;
        double emf = b->torque_constant * speed;
        voltage = clip(b->current_gain * (reference - current) + emf + b->resistance * reference, b->supply);
        current += b->dt * (voltage - emf - b->resistance * current) / b->inductance;
        double torque = b->torque_constant * current;
        double direction = speed > 0.0 || (speed == 0.0 && torque > load) ? 1.0 : b->reverse;
        double through = fabs(load) + fabs(torque);
        double wave = 1.0 + b->ripple * sin(6.283185307179586 * angle / b->per_metre / b->ripple_pitch);
        double level = direction * wave * (b->dry + b->per_load * through);
        double fall = exp(-(speed / b->stribeck) * (speed / b->stribeck));
        double limit = level * (1.0 + b->stick * fall);
        /* Implicit: the bristles are fast against the step where the motor is. */
        double bent = (bristle + b->dt * speed) / (1.0 + b->dt * b->bristle * fabs(speed) / limit);
        double rate = (bent - bristle) / b->dt;
        double dry = b->bristle * bristle + b->bristle_damping * rate * exp(-fabs(speed) / b->stribeck);
        bristle = bent;
        double drag = b->viscous * speed * (1.0 - b->bending * fabs(speed));
        double link = load;
        if (elastic) {
            double force = b->stiffness * (angle / b->per_metre - place)
                         + b->joint_damping * (speed / b->per_metre - pace);
            pace += b->dt * (force - b->weight) / b->mass;
            place += b->dt * pace;
            link = force / b->per_metre;
        }
        speed += b->dt * (torque - link - dry - drag) / inertia;
        angle += b->dt * speed;
        if ((k + 1) % log_every == 0) {
            double *row = rows + ((k + 1) / log_every - 1) * COLUMNS;
            row[POSITION] = elastic ? place : angle / b->per_metre;
            row[SPEED] = elastic ? pace : speed / b->per_metre;
            row[CURRENT] = current;
            row[VOLTAGE] = voltage;
        }
        if (!(fabs(speed) < 1e6)) return 1;
    }
    return 0;
}
