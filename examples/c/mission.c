/* Takes off, flies to a point north of here and lands, and prints what the robot says meanwhile.
 *
 *     mission [ALTITUDE_M]
 *
 * Exit code 0 when all of it was done, 1 when something was refused or failed.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include <hero_ril.h>

/* 0.0001 degrees of latitude are 11 m. */
#define NORTH_DEG 1e-4
/* Telemetry is in SI units, waypoints are in degrees. */
#define DEG_PER_RAD 57.29577951308232

static hero_ril_robot *robot;
static hero_ril_subscriber *telemetry;
static hero_ril_client *client;

/* However the program ends, it leaves nothing behind. Closing a null pointer is harmless. */
static void leave(void) {
    hero_ril_client_close(client);
    hero_ril_unsubscribe(telemetry);
    hero_ril_leave(robot);
}

static void fail(const char *what) {
    fprintf(stderr, "%s: %s\n", what, hero_ril_last_error());
    exit(1);
}

/* Prints the telemetry that has come. */
static void print_telemetry(void) {
    HeroTelemetry sample;
    if (hero_ril_latest(telemetry, &sample, sizeof sample) == HERO_RIL_OK) {
        printf("%" PRIu64 " %.2f m, flying %u\n", sample.sequence, sample.geodetic.altitude_m, (unsigned)sample.flying);
    }
}

/* Follows a request to its final report, and prints telemetry in between. */
static void follow(const char *what, uint64_t id) {
    hero_ril_source sources[2] = {{.subscriber = telemetry}, {.client = client}};
    for (;;) {
        RequestReport report;
        while (hero_ril_next_report(client, id, 0, &report) == HERO_RIL_OK) {
            printf("%s: %s\n", what, hero_ril_stage_name(report.stage));
            if (hero_ril_is_final(&report)) {
                if (report.stage != HERO_STAGE_DONE) {
                    fprintf(stderr, "%s: %s\n", what, hero_ril_reason_name(report.reason));
                    exit(1);
                }
                /* What comes next is a step behind this one: not when somebody else has ordered something meanwhile. */
                hero_ril_follow(client, id);
                return;
            }
        }
        print_telemetry();
        if (hero_ril_wait(sources, 2, 1000) < 0) {
            fail("wait");
        }
    }
}

int main(int argc, char **argv) {
    double altitude_m = argc > 1 ? atof(argv[1]) : 10.0;
    atexit(leave);
    hero_ril_topic topic = hero_ril_hero_telemetry();
    if (hero_ril_join(NULL, 1, "c-mission", &robot) != HERO_RIL_OK ||
        hero_ril_subscribe(robot, &topic, &telemetry) != HERO_RIL_OK ||
        hero_ril_client_open(robot, &client) != HERO_RIL_OK) {
        fail("join");
    }

    HeroTelemetry here;
    int result = hero_ril_receive(telemetry, &here, sizeof here, 5000);
    if (result != HERO_RIL_OK) {
        fprintf(stderr, "no telemetry: %s\n", result < 0 ? hero_ril_last_error() : "start `ril run status`");
        return 1;
    }

    uint64_t id;
    if (hero_ril_start(client, &id) != HERO_RIL_OK) {
        fail("start");
    }
    follow("start", id);
    if (hero_ril_take_off(client, altitude_m, &id) != HERO_RIL_OK) {
        fail("take off");
    }
    follow("take off", id);
    hero_ril_waypoint north = {here.geodetic.latitude_rad * DEG_PER_RAD + NORTH_DEG,
                               here.geodetic.longitude_rad * DEG_PER_RAD, here.geodetic.altitude_m + altitude_m};
    if (hero_ril_go_to(client, &north, 1, 0, &id) != HERO_RIL_OK) {
        fail("go to");
    }
    follow("go to", id);
    if (hero_ril_land(client, 0, &id) != HERO_RIL_OK) {
        fail("land");
    }
    follow("land", id);

    hero_ril_losses losses;
    hero_ril_count(telemetry, &losses);
    printf("%" PRIu64 " samples, %" PRIu64 " lost\n", losses.received, losses.lost);
    return 0;
}
