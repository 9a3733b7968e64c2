/* Yardstick, one run: the closed rotary loop of benchmarks/README.md as one hand-written C loop.
 *
 * Explicit Euler at 1e-6 s: position P, speed PI with conditional integration, inverse transform, three relays of
 * +-0.5 A on a star with a floating neutral, torque, stick-slip friction, end stops and the backlash operator. It has
 * nothing but this one actuator in it: no options, no units, no checks. What it costs is what the job costs.
 *
 *   cc -O3 -march=native benchmark_job.c -lm                sines from libm
 *   cc -O3 -march=native -DFASTTRIG benchmark_job.c -lm     sines from polynomials, good to the last digits
 *   ... -DCOUNT                                             also counts leg transitions (never while timing)
 * Run: ./a.out STEPS REPEATS [RECORD_EVERY]; prints one line of name=value pairs.
 */
#define _GNU_SOURCE
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#ifdef FASTTRIG
/* Reduction to [-pi/4, pi/4] by a two-part pi/2, then odd and even polynomials. */
static inline void sine_cosine(double x, double *s, double *c) {
    double q = nearbyint(x * 0.63661977236758134308);
    long n = (long)q;
    double r = fma(-q, 1.57079632679489655800e+00, x);
    r = fma(-q, 6.12323399573676603587e-17, r);
    double r2 = r * r;
    double sp = r + r * r2 * (-1.66666666666666307e-01 + r2 * (8.33333333332211858e-03
        + r2 * (-1.98412698295895385e-04 + r2 * (2.75573136213857245e-06
        + r2 * (-2.50507477628578072e-08 + r2 * 1.58962301576546568e-10)))));
    double cp = 1 - 0.5 * r2 + r2 * r2 * (4.16666666666665929e-02 + r2 * (-1.38888888888730564e-03
        + r2 * (2.48015872888517045e-05 + r2 * (-2.75573141792967388e-07
        + r2 * (2.08757008419747316e-09 + r2 * -1.13585365213876817e-11)))));
    double a = (n & 1) ? cp : sp, b = (n & 1) ? sp : cp;
    *s = (n & 2) ? -a : a;
    *c = ((n + 1) & 2) ? -b : b;
}
#else
static inline void sine_cosine(double x, double *s, double *c) { sincos(x, s, c); }
#endif

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

typedef struct {
    double ia, ib, ic, w, th, thu, xi;
    int sa, sb, sc;
    long sw;
} State;

__attribute__((noinline)) void run(State *S, long n, double dt, double Tl, double *log, int dec) {
    const double p = 4, R = 2.75, iL = 1 / 30.5e-3, K = 1.1 / 1.5, iJ = 1 / (7.7e-4 + 1.9e-3), Cm = 1e-3;
    const double V2 = 190, h = 0.5, gi = 124, igi = 1 / 124.0, half_backlash = 0.1 * M_PI / 180;
    const double Fst = 0.12, Fdy = 0.06, Kpp = 20, Kps = 0.3, Kis = 6, Tmax = 22, A = 7 * M_PI / 180;
    const double om = 2 * M_PI * 0.2, thmax = 30 * M_PI / 180 * 124, iKt = 1 / 1.1;
    const double h3 = 0.86602540378443864676;
    double ia = S->ia, ib = S->ib, ic = S->ic, w = S->w, th = S->th, thu = S->thu, xi = S->xi;
    double va = S->sa ? V2 : -V2, vb = S->sb ? V2 : -V2, vc = S->sc ? V2 : -V2;
    long sw = 0;
    int d = 0;
    for (long k = 0; k < n; k++) {
        double t = k * dt, s0, c0, s, c;
        sine_cosine(om * t, &s0, &c0);
        double wref = Kpp * (A * s0 - thu) * gi, ew = wref - w, Tr = Kps * ew + xi;
        double Ts = Tr > Tmax ? Tmax : (Tr < -Tmax ? -Tmax : Tr);
        xi += (Ts == Tr) ? Kis * ew * dt : 0;
        double I = Ts * iKt;
        sine_cosine(p * th, &s, &c);
        double ka = c, kb = -0.5 * c + h3 * s, kc = -0.5 * c - h3 * s;
        double ea = I * ka - ia, eb = I * kb - ib, ec = I * kc - ic;
        double na = ea > h ? V2 : (ea < -h ? -V2 : va);
        double nb = eb > h ? V2 : (eb < -h ? -V2 : vb);
        double nc = ec > h ? V2 : (ec < -h ? -V2 : vc);
#ifdef COUNT
        sw += (na != va) + (nb != vb) + (nc != vc);
#endif
        va = na; vb = nb; vc = nc;
        double Kw = K * w, fa = Kw * ka, fb = Kw * kb, fc = Kw * kc;
        double vn = (va + vb + vc - fa - fb - fc) * (1.0 / 3);
        double T = K * (ka * ia + kb * ib + kc * ic) - Tl;
        ia += dt * iL * (va - vn - fa - R * ia);
        ib += dt * iL * (vb - vn - fb - R * ib);
        ic += dt * iL * (vc - vn - fc - R * ic);
        double fs = T > Fst ? Fst : (T < -Fst ? -Fst : T);
        double Tf = (w == 0) ? fs : copysign(Fdy, w);
        double wn = w + dt * iJ * (T - Tf - Cm * w);
        wn = (w * wn < 0) ? 0 : wn;
        double tn = th + dt * wn;
        int lim = fabs(tn) > thmax;
        th = lim ? copysign(thmax, tn) : tn;
        w = lim ? 0 : wn;
        double u = th * igi, lo = u - half_backlash, hi = u + half_backlash;
        thu = thu > hi ? hi : (thu < lo ? lo : thu);
        if (++d == dec) {
            d = 0;
            log[0] = t; log[1] = ia; log[2] = ib; log[3] = ic;
            log[4] = w; log[5] = th; log[6] = thu; log[7] = T;
            log += 8;
        }
    }
    S->ia = ia; S->ib = ib; S->ic = ic; S->w = w; S->th = th; S->thu = thu; S->xi = xi; S->sw = sw;
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int argc, char **argv) {
    long n = argc > 1 ? atol(argv[1]) : 1000000;
    int repeats = argc > 2 ? atoi(argv[2]) : 15, dec = argc > 3 ? atoi(argv[3]) : 2500;
    if (n < 1 || repeats < 1 || repeats > 64 || dec < 1) return 2;
    double *log = malloc(sizeof(double) * 8 * (n / dec + 1)), took[64];
    State S;
    for (int r = 0; r < repeats; r++) {
        S = (State){0};
        double t0 = now();
        run(&S, n, 1e-6, 0.0, log, dec);
        took[r] = now() - t0;
    }
    qsort(took, repeats, 8, ascending);
    printf("steps=%ld ns_per_step=%.4f output_deg=%.9f speed=%.9f transitions=%ld\n", n,
           took[repeats / 2] / n * 1e9, S.thu * 180 / M_PI, S.w, S.sw);
    free(log);
    return 0;
}
