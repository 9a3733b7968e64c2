/* Faults at the system calls that change files below one folder: for tests only, by LD_PRELOAD.
 *
 * Each such call is one point, counted from 1. At the point `at` the process kills itself before
 * the call (KILL), or in the middle of what it writes (TORN), or finds the disk full from there on
 * (FULL: what is written is cut short once, then ENOSPC). Calls on other files go through.
 * What the C library writes from its own buffers (fwrite) does not come by here.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

enum { OFF, COUNT, KILL, TORN, FULL };
enum { MOST = 1 << 16 };

static char root[PATH_MAX];
static size_t root_length;
static int mode = OFF;
static long at, points;
static char kinds[MOST];

void harness_arm(const char *folder, int fault, long point) {
    strncpy(root, folder, sizeof root - 1);
    root_length = strlen(root);
    at = point;
    points = 0;
    mode = fault;
}

long harness_points(char *out) {
    long count = points < MOST ? points : MOST;
    memcpy(out, kinds, (size_t)count);
    return points;
}

static int below(const char *path) {
    return strncmp(path, root, root_length) == 0 &&
           (path[root_length] == '/' || path[root_length] == 0);
}

static int below_at(int folder, const char *path) {
    char place[PATH_MAX], link[64];
    if (mode == OFF || path == NULL) return 0;
    if (path[0] == '/') return below(path);
    if (folder == AT_FDCWD) {
        if (getcwd(place, sizeof place) == NULL) return 0;
        return below(place);
    }
    snprintf(link, sizeof link, "/proc/self/fd/%d", folder);
    ssize_t length = readlink(link, place, sizeof place - 1);
    if (length < 0) return 0;
    place[length] = 0;
    return below(place);
}

static int of(int file) { return below_at(file, "."); }

static void die(void) {
    kill(getpid(), SIGKILL);
    for (;;) pause();
}

/* Count a point; die there, or tell whether the disk is full (1 for the first time, then 2). */
static int point(char kind) {
    long now = __sync_add_and_fetch(&points, 1);
    if (now <= MOST) kinds[now - 1] = kind;
    if ((mode == KILL || (mode == TORN && kind != 'w')) && now == at) die();
    if (mode == TORN && now == at) return 3;
    if (mode == FULL && now >= at && (kind == 'w' || kind == 'c')) return now == at ? 1 : 2;
    return 0;
}

#define REAL(name) __typeof__(&name) real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)
#define NO_SPACE (errno = ENOSPC, -1)

/* Write `size` bytes by `CALL(n)`, or half of them and what the fault brings. */
#define WRITES(file, size, CALL)                                   \
    if (!of(file)) return CALL(size);                              \
    int fault = point('w');                                        \
    if (fault == 0) return CALL(size);                             \
    if (fault != 2 && (size) > 1) {                                \
        ssize_t half = CALL((size) / 2);                           \
        if (fault == 3) die();                                     \
        return half;                                               \
    }                                                              \
    if (fault == 3) die();                                         \
    return NO_SPACE

ssize_t write(int file, const void *data, size_t size) {
    REAL(write);
#define CALL(n) real(file, data, n)
    WRITES(file, size, CALL);
#undef CALL
}

ssize_t pwrite(int file, const void *data, size_t size, off_t where) {
    REAL(pwrite);
#define CALL(n) real(file, data, n, where)
    WRITES(file, size, CALL);
#undef CALL
}

ssize_t pwrite64(int file, const void *data, size_t size, off64_t where) {
    REAL(pwrite64);
#define CALL(n) real(file, data, n, where)
    WRITES(file, size, CALL);
#undef CALL
}

ssize_t writev(int file, const struct iovec *parts, int count) {
    REAL(writev);
#define CALL(n) real(file, parts, (int)(n))
    WRITES(file, count, CALL);
#undef CALL
}

ssize_t sendfile(int out, int in, off_t *where, size_t size) {
    REAL(sendfile);
#define CALL(n) real(out, in, where, n)
    WRITES(out, size, CALL);
#undef CALL
}

ssize_t sendfile64(int out, int in, off64_t *where, size_t size) {
    REAL(sendfile64);
#define CALL(n) real(out, in, where, n)
    WRITES(out, size, CALL);
#undef CALL
}

ssize_t copy_file_range(int in, off64_t *from, int out, off64_t *to, size_t size, unsigned flags) {
    REAL(copy_file_range);
#define CALL(n) real(in, from, out, to, n, flags)
    WRITES(out, size, CALL);
#undef CALL
}

int ftruncate(int file, off_t size) {
    REAL(ftruncate);
    if (of(file)) point('t');
    return real(file, size);
}

int ftruncate64(int file, off64_t size) {
    REAL(ftruncate64);
    if (of(file)) point('t');
    return real(file, size);
}

int fsync(int file) {
    REAL(fsync);
    if (!of(file)) return real(file);
    point('s');
    return 0; /* a kill loses nothing that the system has taken: no need to wait for the disk */
}

int fdatasync(int file) {
    REAL(fdatasync);
    if (!of(file)) return real(file);
    point('s');
    return 0; /* a kill loses nothing that the system has taken: no need to wait for the disk */
}

int rename(const char *from, const char *to) {
    REAL(rename);
    if (below_at(AT_FDCWD, to)) point('r');
    return real(from, to);
}

int renameat(int from_folder, const char *from, int folder, const char *to) {
    REAL(renameat);
    if (below_at(folder, to)) point('r');
    return real(from_folder, from, folder, to);
}

int link(const char *from, const char *to) {
    REAL(link);
    if (below_at(AT_FDCWD, to) && point('c')) return NO_SPACE;
    return real(from, to);
}

int linkat(int from_folder, const char *from, int folder, const char *to, int flags) {
    REAL(linkat);
    if (below_at(folder, to) && point('c')) return NO_SPACE;
    return real(from_folder, from, folder, to, flags);
}

int unlink(const char *path) {
    REAL(unlink);
    if (below_at(AT_FDCWD, path)) point('u');
    return real(path);
}

int unlinkat(int folder, const char *path, int flags) {
    REAL(unlinkat);
    if (below_at(folder, path)) point('u');
    return real(folder, path, flags);
}

int mkdir(const char *path, mode_t rights) {
    REAL(mkdir);
    if (below_at(AT_FDCWD, path) && point('c')) return NO_SPACE;
    return real(path, rights);
}

/* A file that is there is opened without needing space; one that is made needs some. */
#define OPENS(folder, path, flags, CALL)                                             \
    mode_t rights = 0;                                                               \
    if ((flags) & O_CREAT) {                                                         \
        va_list more;                                                                \
        va_start(more, flags);                                                       \
        rights = va_arg(more, mode_t);                                               \
        va_end(more);                                                                \
    }                                                                                \
    if (((flags) & (O_CREAT | O_TRUNC)) && below_at(folder, path)) {                 \
        struct stat about;                                                           \
        char kind = fstatat(folder, path, &about, AT_SYMLINK_NOFOLLOW) ? 'c' : 'o';  \
        if (point(kind)) return NO_SPACE;                                            \
    }                                                                                \
    return CALL

int open(const char *path, int flags, ...) {
    REAL(open);
    OPENS(AT_FDCWD, path, flags, real(path, flags, rights));
}

int open64(const char *path, int flags, ...) {
    REAL(open64);
    OPENS(AT_FDCWD, path, flags, real(path, flags, rights));
}

int openat(int folder, const char *path, int flags, ...) {
    REAL(openat);
    OPENS(folder, path, flags, real(folder, path, flags, rights));
}

int openat64(int folder, const char *path, int flags, ...) {
    REAL(openat64);
    OPENS(folder, path, flags, real(folder, path, flags, rights));
}
