/* Yardstick, many runs: the loop of benchmark_job.c over N runs side by side (structure of arrays), one run a lane.
 *
 * Same equations, same order, polynomial sines without integer conversion so that every instruction set
 * vectorises them. Each lane has its own command (amplitude, frequency), as runs of a batch do.
 *
 *   cc -O3 -march=native -fno-trapping-math -fno-math-errno -fopenmp-simd benchmark_lanes.c -lm
 *   add -mprefer-vector-width=512 where the CPU has AVX-512, -DLANES=8 for another width
 * Run: ./a.out STEPS REPEATS [RECORD_EVERY]; prints one line of name=value pairs (lane 0 is the common job).
 */
#define _GNU_SOURCE
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifndef LANES
#define LANES 64
#endif
#define N LANES

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

/* As in benchmark_job.c, the quadrant kept as a number: q - 4 floor(q / 4) is 0, 1, 2 or 3. */
static inline void sine_cosine(double x, double *s, double *c) {
    double q = __builtin_rint(x * 0.63661977236758134308);
    double r = fma(-q, 1.57079632679489655800e+00, x);
    r = fma(-q, 6.12323399573676603587e-17, r);
    double r2 = r * r;
    double sp = r + r * r2 * (-1.66666666666666307e-01 + r2 * (8.33333333332211858e-03
        + r2 * (-1.98412698295895385e-04 + r2 * (2.75573136213857245e-06
        + r2 * (-2.50507477628578072e-08 + r2 * 1.58962301576546568e-10)))));
    double cp = 1 - 0.5 * r2 + r2 * r2 * (4.16666666666665929e-02 + r2 * (-1.38888888888730564e-03
        + r2 * (2.48015872888517045e-05 + r2 * (-2.75573141792967388e-07
        + r2 * (2.08757008419747316e-09 + r2 * -1.13585365213876817e-11)))));
    double n = q - 4 * __builtin_floor(q * 0.25);
    int odd = (n == 1) | (n == 3);
    double a = odd ? cp : sp, b = odd ? sp : cp;
    *s = n >= 2 ? -a : a;
    *c = ((n == 1) | (n == 2)) ? -b : b;
}

typedef struct {
    double ia[N], ib[N], ic[N], w[N], th[N], thu[N], xi[N], va[N], vb[N], vc[N], A[N], om[N], T[N];
} __attribute__((aligned(64))) State;

__attribute__((noinline)) static void run(State *restrict S, long n, double dt, double *restrict log, int dec) {
    const double p = 4, R = 2.75, iL = 1 / 30.5e-3, K = 1.1 / 1.5, iJ = 1 / (7.7e-4 + 1.9e-3), Cm = 1e-3;
    const double V2 = 190, h = 0.5, gi = 124, igi = 1 / 124.0, half_backlash = 0.1 * M_PI / 180;
    const double Fst = 0.12, Fdy = 0.06, Kpp = 20, Kps = 0.3, Kis = 6, Tmax = 22;
    const double thmax = 30 * M_PI / 180 * 124, iKt = 1 / 1.1, h3 = 0.86602540378443864676;
    int d = 0;
    for (long k = 0; k < n; k++) {
        double t = k * dt;
#pragma omp simd
        for (int j = 0; j < N; j++) {
            double ia = S->ia[j], ib = S->ib[j], ic = S->ic[j], w = S->w[j], th = S->th[j];
            double thu = S->thu[j], xi = S->xi[j], va = S->va[j], vb = S->vb[j], vc = S->vc[j];
            double s0, c0, s, c;
            sine_cosine(S->om[j] * t, &s0, &c0);
            double wref = Kpp * (S->A[j] * s0 - thu) * gi, ew = wref - w, Tr = Kps * ew + xi;
            double Ts = Tr > Tmax ? Tmax : Tr;
            Ts = Ts < -Tmax ? -Tmax : Ts;
            xi += Ts == Tr ? Kis * ew * dt : 0;
            double I = Ts * iKt;
            sine_cosine(p * th, &s, &c);
            double ka = c, kb = -0.5 * c + h3 * s, kc = -0.5 * c - h3 * s;
            double ea = I * ka - ia, eb = I * kb - ib, ec = I * kc - ic;
            va = ea < -h ? -V2 : va; va = ea > h ? V2 : va;
            vb = eb < -h ? -V2 : vb; vb = eb > h ? V2 : vb;
            vc = ec < -h ? -V2 : vc; vc = ec > h ? V2 : vc;
            double Kw = K * w, fa = Kw * ka, fb = Kw * kb, fc = Kw * kc;
            double vn = (va + vb + vc - fa - fb - fc) * (1.0 / 3);
            double T = K * (ka * ia + kb * ib + kc * ic);
            ia += dt * iL * (va - vn - fa - R * ia);
            ib += dt * iL * (vb - vn - fb - R * ib);
            ic += dt * iL * (vc - vn - fc - R * ic);
            double fs = T > Fst ? Fst : T;
            fs = fs < -Fst ? -Fst : fs;
            double slide = __builtin_copysign(Fdy, w);
            double Tf = w == 0 ? fs : slide;
            double wn = w + dt * iJ * (T - Tf - Cm * w);
            wn = w * wn < 0 ? 0 : wn;
            double tn = th + dt * wn, at = __builtin_fabs(tn);
            double stop = __builtin_copysign(thmax, tn);
            th = at > thmax ? stop : tn;
            w = at > thmax ? 0 : wn;
            double u = th * igi, lo = u - half_backlash, hi = u + half_backlash;
            thu = thu < lo ? lo : thu;
            thu = thu > hi ? hi : thu;
            S->ia[j] = ia; S->ib[j] = ib; S->ic[j] = ic; S->w[j] = w; S->th[j] = th; S->thu[j] = thu;
            S->xi[j] = xi; S->va[j] = va; S->vb[j] = vb; S->vc[j] = vc; S->T[j] = T;
        }
        if (++d == dec) {
            d = 0;
            memcpy(log, S->ia, sizeof S->ia); memcpy(log + N, S->ib, sizeof S->ib);
            memcpy(log + 2 * N, S->ic, sizeof S->ic); memcpy(log + 3 * N, S->w, sizeof S->w);
            memcpy(log + 4 * N, S->th, sizeof S->th); memcpy(log + 5 * N, S->thu, sizeof S->thu);
            memcpy(log + 6 * N, S->T, sizeof S->T);
            log += 7 * N;
        }
    }
}

static void reset(State *S) {
    memset(S, 0, sizeof *S);
    for (int j = 0; j < N; j++) {
        S->va[j] = S->vb[j] = S->vc[j] = -190;
        S->A[j] = (7 + 0.05 * j) * M_PI / 180;
        S->om[j] = 2 * M_PI * 0.2;
    }
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int argc, char **argv) {
    long n = argc > 1 ? atol(argv[1]) : 200000;
    int repeats = argc > 2 ? atoi(argv[2]) : 5, dec = argc > 3 ? atoi(argv[3]) : 2500;
    if (n < 1 || repeats < 1 || repeats > 64 || dec < 1) return 2;
    double *log = malloc(sizeof(double) * 7 * N * (n / dec + 1)), took[64];
    static State S;
    for (int r = 0; r < repeats; r++) {
        reset(&S);
        double t0 = now();
        run(&S, n, 1e-6, log, dec);
        took[r] = now() - t0;
    }
    qsort(took, repeats, 8, ascending);
    printf("steps=%ld lanes=%d ns_per_lane_step=%.4f output_deg=%.9f speed=%.9f\n", n, N,
           took[repeats / 2] / n / N * 1e9, S.thu[0] * 180 / M_PI, S.w[0]);
    free(log);
    return 0;
}
