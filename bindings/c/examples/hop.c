/* The consumer of hop.rs in C: hop SAMPLES WARM_UP */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <hero_ril.h>

static int compare(const void *one, const void *other) {
    double a = *(const double *)one, b = *(const double *)other;
    return (a > b) - (a < b);
}

int main(int argc, char **argv) {
    size_t samples = argc > 2 ? strtoul(argv[1], NULL, 10) : 1000;
    size_t warm_up = argc > 2 ? strtoul(argv[2], NULL, 10) : 100;
    double *hops = malloc(samples * sizeof *hops);
    hero_ril_robot *robot;
    hero_ril_subscriber *telemetry;
    hero_ril_topic topic = hero_ril_hero_telemetry();
    if (hops == NULL || hero_ril_join(NULL, 1, "hop-c", &robot) != HERO_RIL_OK ||
        hero_ril_subscribe(robot, &topic, &telemetry) != HERO_RIL_OK) {
        fprintf(stderr, "%s\n", hero_ril_last_error());
        return 1;
    }
    HeroTelemetry sample;
    for (size_t number = 0; number < samples;) {
        if (hero_ril_receive(telemetry, &sample, sizeof sample, 1000) == HERO_RIL_OK) {
            struct timespec now;
            clock_gettime(CLOCK_MONOTONIC, &now);
            uint64_t now_ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
            hops[number++] = (double)(now_ns - sample.received_ns) / 1000.0;
        }
    }
    qsort(hops + warm_up, samples - warm_up, sizeof *hops, compare);
    printf("%f\n", hops[warm_up + (samples - warm_up) / 2]);
    hero_ril_unsubscribe(telemetry);
    hero_ril_leave(robot);
    free(hops);
    return 0;
}
