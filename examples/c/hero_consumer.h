/* A consumer of what the HERO RIL publishes, for C11: sections 3, 5, 8 and 10 of docs/ipc.md as five functions.
 *
 * Needs iceoryx2's C binding 0.10.0 and hero_ipc.h, which is made of the RIL's own structs. It only reads: it publishes
 * nothing and sends no request. A consumer belongs to the thread that opened it. */
#ifndef HERO_CONSUMER_H
#define HERO_CONSUMER_H

#include <stddef.h>
#include <stdint.h>

#include "hero_ipc.h"

/* What a published service carries. */
typedef struct hero_topic {
    const char *key;
    const char *layout;
    const char *layout_hash;
    size_t size;
    size_t align;
} hero_topic;

extern const hero_topic hero_topic_dsp_telemetry;
extern const hero_topic hero_topic_hero_telemetry;
extern const hero_topic hero_topic_module_state;

/* The numbers are the exit codes of `ril` for the same trouble. */
enum hero_result {
    HERO_OK = 0,
    /* iceoryx2 failed, or the service carries another layout than hero_ipc.h. */
    HERO_FAILED = 1,
    /* Nothing of the RIL runs, or nobody has opened the service. */
    HERO_NOT_THERE = 3,
};

typedef struct hero_consumer hero_consumer;

/* Opens a robot's service. On failure `*consumer` is NULL and `error` has a sentence with what to do. */
enum hero_result hero_consumer_open(hero_consumer **consumer, const hero_topic *topic, uint32_t robot, char *error,
                                    size_t error_size);

/* Sleeps until there is a sample, a signal comes or the time has passed: 1 for a sample, 0 otherwise, -1 on failure. */
int hero_consumer_wait(hero_consumer *consumer, uint32_t timeout_ms);

/* Copies the next sample, which has the size of the topic: 1 for a sample, 0 for none, -1 on failure. */
int hero_consumer_next(hero_consumer *consumer, void *sample);

/* Samples that were published and never came, by gaps of the sequence. */
uint64_t hero_consumer_lost(const hero_consumer *consumer);

/* Gives everything back. NULL is allowed. */
void hero_consumer_close(hero_consumer *consumer);

#endif
