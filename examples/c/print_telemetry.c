/* Prints the robot's telemetry: print_telemetry [COUNT]. Ends after COUNT samples, or with Ctrl+C. Exit codes are those of
 * `ril`: 3 when nobody publishes. */
#define _DEFAULT_SOURCE

#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>

#include "hero_consumer.h"

static volatile sig_atomic_t is_ending = 0;

static void end(int signal) {
    (void)signal;
    is_ending = 1;
}

int main(int argc, char **argv) {
    uint64_t count = argc > 1 ? strtoull(argv[1], NULL, 10) : UINT64_MAX;
    struct sigaction action = {.sa_handler = end};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);

    hero_consumer *telemetry = NULL;
    char error[512];
    enum hero_result result = hero_consumer_open(&telemetry, &hero_topic_hero_telemetry, 1, error, sizeof(error));
    if (result != HERO_OK) {
        fprintf(stderr, "error: %s\n", error);
        return result;
    }
    fprintf(stderr, "subscribed\n");
    HeroTelemetry sample;
    int state = 0;
    while (count > 0 && !is_ending && (state = hero_consumer_wait(telemetry, 1000)) >= 0) {
        while (count > 0 && (state = hero_consumer_next(telemetry, &sample)) > 0) {
            if (sample.valid_groups & HERO_TELEMETRY_GROUP_GEOGRAPHIC) {
                printf("%" PRIu64 " %.2f m, ", sample.sequence, sample.geodetic.altitude_m);
            } else {
                printf("%" PRIu64 " - m, ", sample.sequence);
            }
            printf("flying %" PRIu32 ", %" PRIu64 " lost\n", sample.flying, hero_consumer_lost(telemetry));
            fflush(stdout);
            count--;
        }
    }
    hero_consumer_close(telemetry);
    return state < 0 ? HERO_FAILED : HERO_OK;
}
