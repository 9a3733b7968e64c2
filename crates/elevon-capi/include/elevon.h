/* C interface of Elevon (docs/how-to/deploy.md). Made by cbindgen from crates/elevon-capi/src/c.rs: do not edit. */

#ifndef ELEVON_H
#define ELEVON_H

#include <stddef.h>
#include <stdint.h>

/*
 Done.
 */
#define ELEVON_OK 0

/*
 Done; the drive has tripped, or its control unit has given up.
 */
#define ELEVON_TRIPPED 1

/*
 Done; the winding has passed its limit, and the run stands.
 */
#define ELEVON_OVERHEATED 2

/*
 A null pointer, an index that does not exist, a number that is none, too little room.
 */
#define ELEVON_ARGUMENT -1

/*
 A value outside its range, alone or with the others.
 */
#define ELEVON_RANGE -2

/*
 A time that is no whole number of solver steps.
 */
#define ELEVON_STEP -3

/*
 The run has left the finite numbers, and stands.
 */
#define ELEVON_ENDED -4

/*
 No state of a run made from the same document, or a damaged one.
 */
#define ELEVON_STATE -5

/*
 The document cannot be run.
 */
#define ELEVON_DOCUMENT -6

/*
 Another thread is at work on the run.
 */
#define ELEVON_BUSY -7

/*
 A defect of Elevon: the run is lost.
 */
#define ELEVON_DEFECT -8

/*
 A run. One thread at a time; several runs are independent of each other.
 */
typedef struct ElevonRun ElevonRun;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 Makes a run from a document that `elevon export run` wrote (a text that ends with a zero). It takes all its memory here.
 On failure `message` (of `room` bytes, or null) has the reason.

 # Safety
 The pointers are null or valid.
 */
int elevon_create(const char *document,
                  struct ElevonRun **run,
                  char *message,
                  size_t room);

/*
 Frees a run; null is none.

 # Safety
 `run` is null or of `elevon_create`, not freed, and no other call is at work on it.
 */
void elevon_free(struct ElevonRun *run);

/*
 Steps on by a whole number of solver steps, in s.

 # Safety
 As `elevon_free`, of a run that goes on.
 */
int elevon_step(struct ElevonRun *run, double seconds);

/*
 Holds an input at a value (SI) from now on.

 # Safety
 As `elevon_step`.
 */
int elevon_set_input(struct ElevonRun *run, size_t index, double value);

/*
 Gives a fault a severity (SI) from now on; 0 is healthy.

 # Safety
 As `elevon_step`.
 */
int elevon_set_fault(struct ElevonRun *run, size_t index, double severity);

/*
 Reads all outputs (SI), in their order, into `count` numbers.

 # Safety
 As `elevon_step`; `values` has room for `count` numbers.
 */
int elevon_read(struct ElevonRun *run, double *values, size_t count);

/*
 Writes time and solver step (s), and how many inputs, outputs and faults there are; pointers may be null.

 # Safety
 As `elevon_step`; the pointers are null or valid.
 */
int elevon_describe(struct ElevonRun *run,
                    double *time,
                    double *solver_step,
                    size_t *inputs,
                    size_t *outputs,
                    size_t *faults);

/*
 Finds an input (`command`), an output (`output_position`) or a fault (`short@motor.phase_a`): `what` is 0, 1 or 2.

 # Safety
 As `elevon_step`; `name` ends with a zero, `index` is valid.
 */
int elevon_find(struct ElevonRun *run,
                int what,
                const char *name,
                size_t *index);

/*
 Writes the bytes that a state of the run takes.

 # Safety
 As `elevon_step`; `size` is valid.
 */
int elevon_state_size(struct ElevonRun *run, size_t *size);

/*
 Writes the state into memory of `size` bytes.

 # Safety
 As `elevon_step`; `bytes` has `size` bytes.
 */
int elevon_save(struct ElevonRun *run, uint8_t *bytes, size_t size);

/*
 Goes back, or forth, to a state that this run or one made from the same document wrote.

 # Safety
 As `elevon_step`; `bytes` has `size` bytes.
 */
int elevon_restore(struct ElevonRun *run, const uint8_t *bytes, size_t size);

/*
 The text of the last error of a run; it stays until the next one.

 # Safety
 As `elevon_step`.
 */
const char *elevon_message(const struct ElevonRun *run);

/*
 What a code means.
 */
const char *elevon_code_text(int code);

/*
 The version of Elevon.
 */
const char *elevon_version(void);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ELEVON_H */
