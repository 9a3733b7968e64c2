/* The plant and the drive of the foreign bench: written apart from the package, for its tests. */
#include <math.h>
#include <stdlib.h>

/* Every field is a double: the caller reads their names and order from this text. */
struct bench {
    double steps;              /* of the integration */
    double dt;                 /* s */
    double control_every;      /* steps between two samples of the speed controller */
    double position_every;     /* steps between two samples of the position controller */
    double log_every;          /* steps between two rows of the log */
    double ratio;              /* gear, fast over output */
    double torque_constant;    /* N m per A peak */
    double inertia;            /* kg m2, motor shaft */
    double dry;                /* N m, motor shaft, moving */
    double stick;              /* N m, motor shaft, at rest */
    double stribeck;           /* rad/s over which rest turns into motion; 0: at once */
    double falling;            /* exponent of the fall from rest to motion */
    double bristle;            /* N m/rad, stiffness of LuGre's bristles; 0: at rest the shaft is held */
    double bristle_damping;    /* N m s/rad */
    double load_share;         /* by which dry friction grows with the torque through the gear */
    double viscous;            /* N m s/rad */
    double cogging;            /* N m */
    double cogging_teeth;      /* periods a turn */
    double backlash;               /* rad at the output, total */
    double elastic;            /* 0: kinematic dragging; 1: two masses */
    double stiffness;          /* N m/rad at the output */
    double damping;            /* N m s/rad at the output */
    double output_inertia;       /* kg m2 */
    double output_dry;           /* N m */
    double speed_gain;         /* N m s/rad */
    double integral_time;      /* s; 0: none */
    double derivative_time;    /* s */
    double derivative_filter;  /* N; 0: unfiltered */
    double believed_constant;  /* N m/A, of the controller */
    double current_limit;      /* A peak */
    double position_gain;      /* 1/s, output error to motor-shaft speed */
    double speed_limit;        /* rad/s */
    double current_lag;        /* s, of the current loop */
    double speed_by_counts;    /* 1: the controller's speed is a difference of motor counts */
    double encoder_counts;     /* an output turn */
    double encoder_gain;
    double encoder_offset;     /* rad */
    double encoder_error;      /* rad at the output, once a turn of the encoder's wheel */
    double encoder_turns;      /* of that wheel an output turn */
    double encoder_phase;      /* rad: where the wheel stands when the drive is switched on */
    double encoder_delay;      /* s, of the logged value */
    double quantised_loop;     /* 1: the position loop sees counts */
    double motor_counts;       /* a motor turn */
    double cutoff;             /* Hz, of the logged current */
    double speed_cutoff;       /* Hz, of the logged speed; 0: none */
    double resistance;         /* ohm */
    double inductance;         /* H */
    double output_start;         /* rad */
    double motor_start;        /* share of half the backlash, -1 to 1 */
    double wheel;              /* rad at the output, error of the gear once an output turn; 0: none */
    double wheel_phase;        /* rad */
    double pinion;             /* rad at the output, error of the gear once a motor turn; 0: none */
    double pinion_phase;       /* rad */
    double phase_offset;       /* A, of one phase's current sensor: a torque once an electrical turn */
    double pole_pairs;
    double warming;            /* 1/s, growth of the resistance */
    double pull;               /* N m on the motor shaft, constant */
};

enum { OUTPUT, MOTOR, SPEED_REF, SPEED, CURRENT_REF, CURRENT, VOLTAGE, REACTION, COLUMNS };

static const double TURN = 6.283185307179586;

static double clip(double x, double limit)
{
    return x > limit ? limit : x < -limit ? -limit : x;
}

/* What the encoder shows of an output angle. */
static double read_by(const struct bench *b, double output)
{
    return b->encoder_gain * output + b->encoder_offset
         + b->encoder_error * sin(b->encoder_turns * output + b->encoder_phase);
}

static double counted(double angle, double counts)
{
    return nearbyint(angle * counts / TURN) * TURN / counts;
}

/* One step of a body with dry friction that holds it at rest; the friction's torque comes back. */
static double slide(double *w, double active, double stick, double dry, double j, double dt)
{
    double friction;
    if (*w == 0.0) {
        friction = clip(active, stick);
        *w = (active - friction) / j * dt;
        return friction;
    }
    friction = *w > 0.0 ? dry : -dry;
    double fresh = *w + (active - friction) / j * dt;
    *w = fresh * *w < 0.0 ? 0.0 : fresh;
    return friction;
}

/* One step of a body on LuGre's bristles; z is their deflection, the friction's torque comes back.
   The deflection is solved implicitly in itself, so that stiff bristles bear the step. */
static double bristled(const struct bench *b, double *w, double *z, double active, double level, double dt)
{
    const double before = *z;
    *z = (before + *w * dt) / (1.0 + b->bristle * fabs(*w) / level * dt);
    const double friction = b->bristle * *z + b->bristle_damping * (*z - before) / dt;
    *w += (active - friction) / b->inertia * dt;
    return friction;
}

/* command [rad at the output] and brake [N m on the motor shaft]: one value a position sample.
   rows: COLUMNS values a log row. Returns 1 where the motion runs away. */
int run(const struct bench *b, const double *command, const double *brake, double *rows)
{
    const long steps = (long)b->steps, every = (long)b->control_every;
    const long outer = (long)b->position_every, log = (long)b->log_every;
    const long late = lround(b->encoder_delay / b->dt);
    const double dt = b->dt, half = 0.5 * b->backlash, sample = dt * every;
    const double follow = 1.0 - exp(-dt / b->current_lag);
    const double smooth = 1.0 - exp(-TURN * b->cutoff * dt);
    const double slow = b->speed_cutoff > 0.0 ? 1.0 - exp(-TURN * b->speed_cutoff * dt) : 1.0;
    const double lag = b->derivative_filter > 0.0 ? b->derivative_time / b->derivative_filter : 0.0;
    double output = b->output_start, output_w = 0.0;
    double motor = b->ratio * (output + half * b->motor_start), w = 0.0;
    double i = 0.0, i_ref = 0.0, i_shown = 0.0, w_shown = 0.0, w_ref = 0.0;
    double sum = 0.0, rate = 0.0, last_error = 0.0, last_motor = counted(motor, b->motor_counts);
    double load = 0.0, z = 0.0;
    double *past = calloc((size_t)late + 1, sizeof(double));
    if (past == NULL)
        return 1;
    for (long k = 0; k <= late; k++)
        past[k] = output;
    for (long n = 0; n < steps; n++) {
        const double b_now = brake[n / outer];
        past[n % (late + 1)] = output;
        if (n % outer == 0) {
            double seen = read_by(b, output);
            if (b->quantised_loop)
                seen = counted(seen, b->encoder_counts);
            w_ref = clip(b->position_gain * (command[n / outer] - seen), b->speed_limit);
        }
        if (n % every == 0) {
            double measured = w;
            if (b->speed_by_counts) {
                double now = counted(motor, b->motor_counts);
                measured = n ? (now - last_motor) / sample : 0.0;
                last_motor = now;
            }
            const double e = w_ref - measured;
            const double kd = b->speed_gain * b->derivative_time;
            rate = (lag * rate + kd * (e - last_error)) / (lag + sample);
            last_error = e;
            double step = b->integral_time > 0.0 ? b->speed_gain / b->integral_time * e * sample : 0.0;
            double torque = b->speed_gain * e + sum + step + rate;
            double most = b->believed_constant * b->current_limit;
            if (fabs(torque) <= most || torque * e < 0.0)
                sum += step;
            i_ref = clip(torque, most) / b->believed_constant;
        }
        const double i_before = i;
        i += (i_ref - i) * follow;
        i_shown += (i - i_shown) * smooth;
        w_shown += (w - w_shown) * slow;
        const double made = i - b->phase_offset * sin(b->pole_pairs * motor);
        double active = b->torque_constant * made - b->pull + b->cogging * sin(b->cogging_teeth * motor)
                      - b->viscous * w - load / b->ratio;
        double moving = b->dry;
        if (b->stribeck > 0.0)
            moving += (b->stick - b->dry) * exp(-pow(fabs(w) / b->stribeck, b->falling));
        const double pressed = 1.0 + b->load_share * (b_now + fabs(load) / b->ratio);
        moving *= pressed;
        const double stick = pressed * b->stick + b_now;
        const double share = b_now / (w == 0.0 ? stick : moving + b_now);
        const double friction = b->bristle > 0.0
                                    ? bristled(b, &w, &z, active, moving + b_now, dt)
                                    : slide(&w, active, stick, moving + b_now, b->inertia, dt);
        if (n % log == 0) {
            double *row = rows + n / log * COLUMNS;
            double seen = read_by(b, past[(n + 1) % (late + 1)]);
            row[OUTPUT] = counted(seen, b->encoder_counts);
            row[MOTOR] = motor;
            row[SPEED_REF] = w_ref;
            row[SPEED] = w_shown;
            row[CURRENT_REF] = i_ref;
            row[CURRENT] = i_shown;
            row[VOLTAGE] = b->resistance * (1.0 + b->warming * n * dt) * i + b->inductance * (i - i_before) / dt
                         + b->torque_constant / 1.5 * w;
            row[REACTION] = friction * share;
        }
        motor += w * dt;
        const double meshed = motor / b->ratio + b->wheel * sin(output + b->wheel_phase)
                            + b->pinion * sin(motor + b->pinion_phase);
        const double lead = meshed - output;
        if (b->elastic) {
            load = 0.0;
            if (fabs(lead) > half) {
                load = b->stiffness * (lead - copysign(half, lead))
                     + b->damping * (w / b->ratio - output_w);
                if (load * lead < 0.0)
                    load = 0.0;
            }
            slide(&output_w, load, b->output_dry, b->output_dry, b->output_inertia, dt);
            output += output_w * dt;
        } else if (lead > half) {
            output = meshed - half;
        } else if (lead < -half) {
            output = meshed + half;
        }
        if (!(fabs(w) < 1e4)) {
            free(past);
            return 1;
        }
    }
    free(past);
    return 0;
}
