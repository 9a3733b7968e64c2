/* Counts what a run takes from the heap after it was made. Its own malloc stands before the C library's. */

#include "elevon.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);

static int watched;
static long calls;

void *malloc(size_t n) { calls += watched; return __libc_malloc(n); }
void *calloc(size_t n, size_t m) { calls += watched; return __libc_calloc(n, m); }
void *realloc(void *p, size_t n) { calls += watched; return __libc_realloc(p, n); }
void *aligned_alloc(size_t a, size_t n) { calls += watched; return __libc_memalign(a, n); }
void *memalign(size_t a, size_t n) { calls += watched; return __libc_memalign(a, n); }
int posix_memalign(void **p, size_t a, size_t n) {
    calls += watched;
    *p = __libc_memalign(a, n);
    return *p ? 0 : 12;
}

static long counted(const char *what, long before) {
    if (calls != before) fprintf(stderr, "%s: %ld calls\n", what, calls - before);
    return calls;
}

int main(int argc, char **argv) {
    static char document[1 << 20];
    FILE *file = fopen(argv[1], "rb");
    if (argc < 4 || !file || !fread(document, 1, sizeof document - 1, file)) return 2;
    fclose(file);
    struct ElevonRun *run = NULL;
    char message[256];
    if (elevon_create(document, &run, message, sizeof message) < 0) {
        fprintf(stderr, "%s\n", message);
        return 2;
    }
    size_t size, outputs, inputs, fault, command;
    static unsigned char state[1 << 20];
    static double values[256];
    elevon_describe(run, NULL, NULL, &inputs, &outputs, NULL);
    if (elevon_find(run, 2, argv[2], &fault) < 0 || elevon_find(run, 0, "command", &command) < 0) return 2;
    double severity = atof(argv[3]);
    /* A first call may set up what the C library keeps a thread. */
    elevon_state_size(run, &size);
    if (size > sizeof state) return 2;
    watched = 1;
    long before = calls, done = 0;
    for (int k = 0; k < 300; k++) {
        done += elevon_set_input(run, command, argc > 4 ? 1.0 : 0.01 * (k % 7)) >= 0;
        before = counted("set_input", before);
        if (k == 50 || k == 200) done += elevon_set_fault(run, fault, k == 50 ? severity : 0.0) >= 0;
        before = counted("set_fault", before);
        done += elevon_step(run, 1e-3) >= 0;
        before = counted("step", before);
        done += elevon_read(run, values, outputs) >= 0;
        before = counted("read", before);
        if (k == 100) done += elevon_save(run, state, size) >= 0;
        if (k == 150) done += elevon_restore(run, state, size) >= 0;
        before = counted("state", before);
        elevon_step(run, -1.0);
        elevon_set_input(run, command, 0.0 / 0.0);
        elevon_set_fault(run, fault, -7e9);
        before = counted("refused calls", before);
    }
    watched = 0;
    printf("%ld calls of the heap, %ld calls done\n", calls, done);
    elevon_free(run);
    return calls == 0 ? 0 : 1;
}
