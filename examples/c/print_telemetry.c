/* Prints telemetry until Ctrl+C, or so many samples: print_telemetry [COUNT] */
#define _POSIX_C_SOURCE 200809L
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>

#include <hero_ril.h>

static volatile sig_atomic_t is_over;

static void end(int signal) {
    (void)signal;
    is_over = 1;
}

static int print(hero_ril_subscriber *telemetry, long count) {
    while (!is_over && count != 0) {
        HeroTelemetry sample;
        hero_ril_losses losses;
        int result = hero_ril_receive(telemetry, &sample, sizeof sample, 1000);
        if (result < 0 || hero_ril_count(telemetry, &losses) < 0) {
            fprintf(stderr, "receive: %s\n", hero_ril_last_error());
            return 1;
        }
        if (result == HERO_RIL_OK) {
            printf("%" PRIu64 " %.2f m, flying %u, %" PRIu64 " lost\n", sample.sequence, sample.geodetic.altitude_m,
                   (unsigned)sample.flying, losses.lost);
            fflush(stdout);
            count--;
        }
    }
    return 0;
}

int main(int argc, char **argv) {
    struct sigaction action = {.sa_handler = end};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);

    hero_ril_robot *robot;
    hero_ril_subscriber *telemetry;
    hero_ril_topic topic = hero_ril_hero_telemetry();
    if (hero_ril_join(NULL, 1, "c-print-telemetry", &robot) != HERO_RIL_OK) {
        fprintf(stderr, "join: %s\n", hero_ril_last_error());
        return 1;
    }
    if (hero_ril_subscribe(robot, &topic, &telemetry) != HERO_RIL_OK) {
        fprintf(stderr, "subscribe: %s\n", hero_ril_last_error());
        hero_ril_leave(robot);
        return 1;
    }
    fputs("subscribed\n", stderr);
    int result = print(telemetry, argc > 1 ? atol(argv[1]) : -1);
    hero_ril_unsubscribe(telemetry);
    hero_ril_leave(robot);
    return result;
}
