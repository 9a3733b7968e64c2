/* A speed controller (PI, limited) as a co-simulation FMU 2.0, in plain C without headers.
   Real: 0 reference [rev/min], 1 speed [rad/s], 2 torque [N.m], 3 kp, 4 ki, 5 limit [N.m].
   Boolean: 6 trips. Integer: 7 steps. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef void (*logger_t)(void *, const char *, int, const char *, const char *, ...);
typedef struct { logger_t logger; void *allocate, *release, *finished, *environment; } callbacks_t;
typedef struct { double r[6], integral; int trips, steps; const callbacks_t *callbacks; } pi_t;

#define OK 0
#define ERROR 3
#define RPM (3.14159265358979323846 / 30.0)

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *place,
                      const callbacks_t *callbacks, int visible, int logging) {
  pi_t *p = strcmp(guid, "{pi}") ? NULL : calloc(1, sizeof *p);
  (void)name; (void)type; (void)place; (void)visible; (void)logging;
  if (p) { p->r[3] = 0.05; p->r[4] = 1.0; p->r[5] = 5.0; p->callbacks = callbacks; }
  return p;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int t, double e, double start, int s, double stop) {
  (void)c; (void)t; (void)e; (void)start; (void)s; (void)stop; return OK;
}
int fmi2EnterInitializationMode(void *c) { (void)c; return OK; }
int fmi2ExitInitializationMode(void *c) { (void)c; return OK; }
int fmi2Terminate(void *c) { (void)c; return OK; }
int fmi2Reset(void *c) { (void)c; return OK; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const k[]) {
  (void)c; (void)on; (void)n; (void)k; return OK;
}
int fmi2SetReal(void *c, const unsigned v[], size_t n, const double x[]) {
  for (size_t i = 0; i < n; i++) ((pi_t *)c)->r[v[i]] = x[i];
  return OK;
}
int fmi2GetReal(void *c, const unsigned v[], size_t n, double x[]) {
  for (size_t i = 0; i < n; i++) x[i] = ((pi_t *)c)->r[v[i]];
  return OK;
}
int fmi2SetInteger(void *c, const unsigned v[], size_t n, const int x[]) {
  (void)c; (void)v; (void)n; (void)x; return ERROR;
}
int fmi2GetInteger(void *c, const unsigned v[], size_t n, int x[]) {
  (void)v; for (size_t i = 0; i < n; i++) x[i] = ((pi_t *)c)->steps; return OK;
}
int fmi2SetBoolean(void *c, const unsigned v[], size_t n, const int x[]) {
  (void)v; for (size_t i = 0; i < n; i++) ((pi_t *)c)->trips = x[i]; return OK;
}
int fmi2GetBoolean(void *c, const unsigned v[], size_t n, int x[]) {
  (void)v; for (size_t i = 0; i < n; i++) x[i] = ((pi_t *)c)->trips; return OK;
}
int fmi2DoStep(void *c, double t, double h, int keep) {
  pi_t *p = c;
  double error = RPM * p->r[0] - p->r[1], out;
  (void)t; (void)keep;
  if (p->trips) {
    p->callbacks->logger(p->callbacks->environment, "pi", ERROR, "logStatusError", "the drive tripped");
    return ERROR;
  }
  p->integral += p->r[4] * error * h;
  out = p->r[3] * error + p->integral;
  p->r[2] = fmin(fmax(out, -p->r[5]), p->r[5]);
  p->steps++;
  return OK;
}
/* What a master may ask for and this controller has not. */
#define NONE(name) int name(void) { return ERROR; }
NONE(fmi2GetString) NONE(fmi2SetString) NONE(fmi2GetFMUstate) NONE(fmi2SetFMUstate)
NONE(fmi2FreeFMUstate) NONE(fmi2SerializedFMUstateSize) NONE(fmi2SerializeFMUstate)
NONE(fmi2DeSerializeFMUstate) NONE(fmi2GetDirectionalDerivative) NONE(fmi2CancelStep)
NONE(fmi2SetRealInputDerivatives) NONE(fmi2GetRealOutputDerivatives) NONE(fmi2GetStatus)
NONE(fmi2GetRealStatus) NONE(fmi2GetIntegerStatus) NONE(fmi2GetBooleanStatus) NONE(fmi2GetStringStatus)
