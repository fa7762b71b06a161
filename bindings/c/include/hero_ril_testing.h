/* Fixtures for tests of programs that use hero_ril.h: shared memory of a test's own, and stand-ins for whoever publishes a topic or serves
 * a request. For C11 and C++17, with POSIX threads; nothing but this file and the library is needed.
 *
 *     hero_ril_testing_domain domain;
 *     hero_ril_testing_begin(&domain);                       the programs below this line meet in there
 *     hero_ril_testing_topic belt;
 *     hero_ril_testing_play(&belt, &BELT, samples, 1000);    a thread publishes them as they are read: none is lost
 *     ... the program under test ...
 *     hero_ril_testing_finish(&belt);
 *     hero_ril_testing_end(&domain, 0);                      asserts that nothing is left
 *
 * What fails is said on standard error, with file and line, and ends the process with code 1. */
#ifndef HERO_RIL_TESTING_H
#define HERO_RIL_TESTING_H

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "hero_ril.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How long a wait lasts at most: only a test that hangs meets it. */
#define HERO_RIL_TESTING_WAIT_MS 90000

/* Ends the test when `condition` does not hold, or a function of the library failed. */
#define HERO_RIL_CHECK(condition) \
    ((condition) ? (void)0 : hero_ril_testing_fail(#condition, __FILE__, __LINE__))

static inline void hero_ril_testing_fail(const char *what, const char *file, int line) {
    fprintf(stderr, "%s:%d: not so: %s (%s)\n", file, line, what, hero_ril_last_error());
    exit(1);
}

/* ---- Shared memory of the test's own ---- */

typedef struct hero_ril_testing_domain {
    char root[64];
} hero_ril_testing_domain;

/* What this process and its children join from here on. Before the first thread is started. */
static inline void hero_ril_testing_begin(hero_ril_testing_domain *domain) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    snprintf(domain->root, sizeof domain->root, "/dev/shm/hx%lx-%06lx", (unsigned long)getpid(), (unsigned long)now.tv_nsec & 0xfffffful);
    HERO_RIL_CHECK(setenv("RIL_IPC_ROOT", domain->root, 1) == 0);
}

/* Asserts that nothing is left, after what a killed process may have left was removed if `has_killed`. */
static inline void hero_ril_testing_end(const hero_ril_testing_domain *domain, int has_killed) {
    size_t left = 0;
    HERO_RIL_CHECK(hero_ril_residue(domain->root, has_killed, &left) == HERO_RIL_OK);
    HERO_RIL_CHECK(left == 0);
}

/* ---- In the place of whoever publishes a topic ---- */

typedef struct hero_ril_testing_topic {
    hero_ril_topic of;
    unsigned char *samples;
    size_t count;
    pthread_t thread;
} hero_ril_testing_topic;

static inline void *hero_ril_testing_publish_all(void *context) {
    hero_ril_testing_topic *topic = (hero_ril_testing_topic *)context;
    hero_ril_robot *robot = NULL;
    hero_ril_publisher *publisher = NULL;
    HERO_RIL_CHECK(hero_ril_join(NULL, 1, "stand_in_topic", &robot) == HERO_RIL_OK);
    HERO_RIL_CHECK(hero_ril_advertise_patient(robot, &topic->of, HERO_RIL_TESTING_WAIT_MS, &publisher) == HERO_RIL_OK);
    for (size_t index = 0; index < topic->count; ++index) {
        const unsigned char *sample = topic->samples + index * topic->of.size;
        HERO_RIL_CHECK(hero_ril_publish(publisher, sample, topic->of.size, NULL) == HERO_RIL_OK);
    }
    hero_ril_withdraw(publisher);
    hero_ril_leave(robot);
    return NULL;
}

/* A thread publishes so many structs, one after the other, as fast as the subscribers read them: none is lost, however long the script is.
 * It waits for the first subscriber, and its publisher ends with the last sample. Play again for one that comes after it. */
static inline void hero_ril_testing_play(hero_ril_testing_topic *topic, const hero_ril_topic *of, const void *samples, size_t count) {
    topic->of = *of;
    topic->count = count;
    topic->samples = (unsigned char *)malloc(of->size * count + 1);
    HERO_RIL_CHECK(topic->samples != NULL);
    memcpy(topic->samples, samples, of->size * count);
    HERO_RIL_CHECK(pthread_create(&topic->thread, NULL, hero_ril_testing_publish_all, topic) == 0);
}

/* Waits until all was published. */
static inline void hero_ril_testing_finish(hero_ril_testing_topic *topic) {
    HERO_RIL_CHECK(pthread_join(topic->thread, NULL) == 0);
    free(topic->samples);
}

/* Bytes of any pattern, always the same for the same seed: a struct of a faulty neighbour. */
static inline void hero_ril_testing_garbage(uint64_t seed, void *bytes, size_t size) {
    for (size_t index = 0; index < size; ++index) {
        seed += 0x9e3779b97f4a7c15u;
        uint64_t mixed = (seed ^ (seed >> 30)) * 0xbf58476d1ce4e5b9u;
        mixed = (mixed ^ (mixed >> 27)) * 0x94d049bb133111ebu;
        ((unsigned char *)bytes)[index] = (unsigned char)(mixed >> 56);
    }
}

/* ---- In the place of whoever serves a request ---- */

/* What becomes of the request `index`, counted from 0: reports about it, or nothing, so that it hangs. False: the server dies. */
typedef int (*hero_ril_testing_answer)(hero_ril_server *server, uint64_t ticket, const void *request, size_t index, void *context);

typedef struct hero_ril_testing_server {
    hero_ril_service of;
    hero_ril_testing_answer answer;
    void *context;
    int is_open; /* These two by the mutex. */
    int is_over;
    pthread_mutex_t mutex;
    pthread_cond_t changed;
    pthread_t thread;
} hero_ril_testing_server;

static inline int hero_ril_testing_set(hero_ril_testing_server *server, int *flag, int value) {
    pthread_mutex_lock(&server->mutex);
    int is_over = server->is_over;
    *flag |= value;
    pthread_cond_broadcast(&server->changed);
    pthread_mutex_unlock(&server->mutex);
    return is_over;
}

static inline void *hero_ril_testing_serve_all(void *context) {
    hero_ril_testing_server *server = (hero_ril_testing_server *)context;
    hero_ril_robot *robot = NULL;
    hero_ril_server *port = NULL;
    size_t index = 0;
    void *request = malloc(server->of.size);
    HERO_RIL_CHECK(request != NULL);
    HERO_RIL_CHECK(hero_ril_join(NULL, 1, "stand_in_server", &robot) == HERO_RIL_OK);
    HERO_RIL_CHECK(hero_ril_serve(robot, &server->of, &port) == HERO_RIL_OK);
    int is_alive = !hero_ril_testing_set(server, &server->is_open, 1);
    while (is_alive) {
        uint64_t ticket;
        int taken = hero_ril_take(port, request, server->of.size, &ticket, 200);
        HERO_RIL_CHECK(taken >= 0);
        is_alive = !hero_ril_testing_set(server, &server->is_over, 0);
        if (taken == HERO_RIL_OK) {
            is_alive = server->answer(port, ticket, request, index++, server->context) && is_alive;
        }
    }
    hero_ril_server_close(port);
    hero_ril_leave(robot);
    free(request);
    return NULL;
}

/* A thread serves requests by `answer`, which runs in it. Returns when the server is there. */
static inline void hero_ril_testing_serve(
    hero_ril_testing_server *server, const hero_ril_service *of, hero_ril_testing_answer answer, void *context) {
    memset(server, 0, sizeof *server);
    server->of = *of;
    server->answer = answer;
    server->context = context;
    pthread_mutex_init(&server->mutex, NULL);
    pthread_cond_init(&server->changed, NULL);
    HERO_RIL_CHECK(pthread_create(&server->thread, NULL, hero_ril_testing_serve_all, server) == 0);
    pthread_mutex_lock(&server->mutex);
    while (!server->is_open) {
        pthread_cond_wait(&server->changed, &server->mutex);
    }
    pthread_mutex_unlock(&server->mutex);
}

static inline void hero_ril_testing_stop(hero_ril_testing_server *server) {
    hero_ril_testing_set(server, &server->is_over, 1);
    HERO_RIL_CHECK(pthread_join(server->thread, NULL) == 0);
    pthread_cond_destroy(&server->changed);
    pthread_mutex_destroy(&server->mutex);
}

/* ---- What a test expects ---- */

/* Follows a request to its end: asserts that no report follows the final one, and gives that. */
static inline RequestReport hero_ril_testing_final(hero_ril_client *client, uint64_t request_id) {
    RequestReport report;
    do {
        HERO_RIL_CHECK(hero_ril_next_report(client, request_id, HERO_RIL_TESTING_WAIT_MS, &report) == HERO_RIL_OK);
    } while (!hero_ril_is_final(&report));
    return report;
}

/* Asserts that the subscriber got every sample that was published since it began. */
static inline void hero_ril_testing_nothing_lost(hero_ril_subscriber *subscriber) {
    hero_ril_losses losses;
    HERO_RIL_CHECK(hero_ril_count(subscriber, &losses) == HERO_RIL_OK);
    HERO_RIL_CHECK(losses.lost == 0 && losses.joined_late == 0);
}

#ifdef __cplusplus
}
#endif
#endif
