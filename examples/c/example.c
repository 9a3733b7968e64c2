/* One second of an actuator, stepped by 1 ms: what a step takes, and that a saved state gives the same bits again.

   make run   (from this folder; `make capi` at the root first)
   ./example DOCUMENT COMMAND   (elevon export run ACTUATOR -o DOCUMENT) */

#define _POSIX_C_SOURCE 199309L
#include "elevon.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { STEPS = 1000, MOST_OUTPUTS = 128 };

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static char *read_text(const char *path) {
    FILE *file = fopen(path, "rb");
    if (!file) return NULL;
    fseek(file, 0, SEEK_END);
    long size = ftell(file);
    rewind(file);
    char *text = size < 0 ? NULL : calloc((size_t)size + 1, 1);
    if (text && fread(text, 1, (size_t)size, file) != (size_t)size) {
        free(text);
        text = NULL;
    }
    fclose(file);
    return text;
}

static int failed(struct ElevonRun *run, const char *what, int code) {
    fprintf(stderr, "%s: %s: %s\n", what, elevon_code_text(code), run ? elevon_message(run) : "");
    return 1;
}

/* Half a second from where the run stands; the outputs at the end, worst and mean time of a step in s. */
static int half(struct ElevonRun *run, double *outputs, size_t count, double *worst, double *sum) {
    for (int k = 0; k < STEPS / 2; k++) {
        double begin = now();
        int code = elevon_step(run, 1e-3);
        double taken = now() - begin;
        if (code < 0) return failed(run, "step", code);
        *sum += taken;
        if (taken > *worst) *worst = taken;
    }
    int code = elevon_read(run, outputs, count);
    return code < 0 ? failed(run, "read", code) : 0;
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: %s DOCUMENT COMMAND\n", argv[0]);
        return 2;
    }
    char *document = read_text(argv[1]);
    if (!document) {
        fprintf(stderr, "%s: cannot be read\n", argv[1]);
        return 2;
    }
    struct ElevonRun *run = NULL;
    char message[256];
    int code = elevon_create(document, &run, message, sizeof message);
    free(document);
    if (code < 0) {
        fprintf(stderr, "%s: %s\n", argv[1], message);
        return 2;
    }
    size_t command, outputs, size;
    double first[MOST_OUTPUTS], again[MOST_OUTPUTS], step, worst = 0.0, sum = 0.0;
    elevon_describe(run, NULL, &step, NULL, &outputs, NULL);
    if (elevon_find(run, 0, "command", &command) < 0 || outputs > MOST_OUTPUTS) return 2;
    code = elevon_set_input(run, command, atof(argv[2]));
    if (code < 0) return failed(run, "command", code);
    if (half(run, first, outputs, &worst, &sum)) return 1;

    elevon_state_size(run, &size);
    unsigned char *state = malloc(size);
    if (!state || elevon_save(run, state, size) < 0) return 1;
    if (half(run, first, outputs, &worst, &sum)) return 1;
    double ignored = 0.0;
    code = elevon_restore(run, state, size);
    if (code < 0) return failed(run, "restore", code);
    if (half(run, again, outputs, &ignored, &ignored)) return 1;
    int same = memcmp(first, again, outputs * sizeof *first) == 0;

    printf("%s: solver step %g s, state %zu bytes\n", argv[1], step, size);
    printf("1 s in %d steps of 1 ms: mean %.1f us, worst %.1f us a step\n", STEPS, 1e6 * sum / STEPS, 1e6 * worst);
    printf("the second half again from the saved state: %s\n", same ? "the same bits" : "OTHER BITS");
    free(state);
    elevon_free(run);
    return same ? 0 : 1;
}
