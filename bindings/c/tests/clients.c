/* A client and a server of requests in one program: what `ril-tests` runs by itself, under valgrind and with a sanitizer.
 *
 * Each part begins with its name, so that the last line of a program that fails says where.
 */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "hero_ril.h"

#define WATCHDOG_MS 60000

static hero_ril_robot *robot;
static hero_ril_server *server;
static hero_ril_client *client;

#define EXPECT(code, expected)                                                                                         \
    do {                                                                                                               \
        int found = (code);                                                                                            \
        if (found != (expected)) {                                                                                     \
            fprintf(stderr, "line %d: %d, not %d: %s\n", __LINE__, found, (int)(expected), hero_ril_last_error());     \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

static double seconds(clockid_t clock) {
    struct timespec now;
    clock_gettime(clock, &now);
    return (double)now.tv_sec + (double)now.tv_nsec / 1e9;
}

/* Ends one request as done. */
static void serve_one(void) {
    MovementData request;
    uint64_t ticket;
    EXPECT(hero_ril_take(server, &request, sizeof request, &ticket, WATCHDOG_MS), HERO_RIL_OK);
    EXPECT(hero_ril_answer(server, ticket, HERO_STAGE_ACCEPTED, HERO_REASON_NONE), HERO_RIL_OK);
    EXPECT(hero_ril_answer(server, ticket, HERO_STAGE_DONE, HERO_REASON_NONE), HERO_RIL_OK);
}

/* Three times as many holds as may be open, whose reports the program does not read. */
static void orders(void) {
    uint64_t id;
    RequestReport report;
    puts("orders");
    for (int i = 0; i < 24; i++) {
        EXPECT(hero_ril_hold(client, NULL), HERO_RIL_OK);
        serve_one();
    }
    EXPECT(hero_ril_land(client, 0, &id), HERO_RIL_OK);
    serve_one();
    EXPECT(hero_ril_next_report(client, id, WATCHDOG_MS, &report), HERO_RIL_OK);
    EXPECT(report.stage, HERO_STAGE_ACCEPTED);
    EXPECT(hero_ril_next_report(client, id, WATCHDOG_MS, &report), HERO_RIL_OK);
    EXPECT(report.stage, HERO_STAGE_DONE);
    /* Those of the holds are there as well. */
    for (int i = 0; i < 48; i++) {
        EXPECT(hero_ril_next_report(client, 0, WATCHDOG_MS, &report), HERO_RIL_OK);
    }
    /* Eight that are open really. */
    for (int i = 0; i < 8; i++) {
        EXPECT(hero_ril_hold(client, NULL), HERO_RIL_OK);
    }
    EXPECT(hero_ril_land(client, 0, &id), HERO_RIL_FULL);
    EXPECT(hero_ril_give_up(client), HERO_RIL_OK);
    /* The server drops them unseen. */
    MovementData request;
    uint64_t ticket;
    EXPECT(hero_ril_take(server, &request, sizeof request, &ticket, 0), HERO_RIL_NOTHING);
}

/* Waiting while no request is open takes the time that it says, and no processor. */
static void idle(void) {
    RequestReport report;
    hero_ril_client *unused;
    puts("idle");
    EXPECT(hero_ril_client_open(robot, &unused), HERO_RIL_OK);
    hero_ril_source clients[2] = {{.client = client}, {.client = unused}};
    double began = seconds(CLOCK_MONOTONIC), used = seconds(CLOCK_PROCESS_CPUTIME_ID);
    EXPECT(hero_ril_wait(clients, 1, 500), HERO_RIL_NOTHING);
    EXPECT(hero_ril_wait(clients + 1, 1, 500), HERO_RIL_NOTHING);
    EXPECT(hero_ril_next_report(client, 0, 500, &report), HERO_RIL_NOTHING);
    EXPECT(hero_ril_next_report(unused, 0, 500, &report), HERO_RIL_NOTHING);
    double took = seconds(CLOCK_MONOTONIC) - began;
    used = seconds(CLOCK_PROCESS_CPUTIME_ID) - used;
    if (took < 2.0 || used > 1.0) {
        fprintf(stderr, "it took %.3f s and used %.3f s of a processor\n", took, used);
        exit(1);
    }
    /* No report about it can come. */
    EXPECT(hero_ril_next_report(client, 1, -1, &report), HERO_RIL_INVALID);
    hero_ril_client_close(unused);
}

/* Arguments that are wrong take nothing, and end nothing. */
static void wrong(void) {
    uint64_t id;
    RequestReport report;
    hero_ril_waypoint waypoint = {37.4, -6.0, 10.0};
    puts("wrong");
    EXPECT(hero_ril_hold(client, &id), HERO_RIL_OK);
    serve_one();
    EXPECT(hero_ril_next_report(client, id, WATCHDOG_MS, NULL), HERO_RIL_INVALID);
    EXPECT(hero_ril_next_report(client, id, WATCHDOG_MS, &report), HERO_RIL_OK);
    EXPECT(report.stage, HERO_STAGE_ACCEPTED);
    EXPECT(hero_ril_next_report(client, id, WATCHDOG_MS, &report), HERO_RIL_OK);

    EXPECT(hero_ril_go_to(client, &waypoint, SIZE_MAX / sizeof waypoint, 0, &id), HERO_RIL_INVALID);
    EXPECT(hero_ril_go_to(client, &waypoint, 1025, 0, &id), HERO_RIL_INVALID);
    EXPECT(hero_ril_go_to(client, &waypoint, 0, 0, &id), HERO_RIL_INVALID);

    hero_ril_source twice[2] = {{.client = client}, {.server = server, .client = client}};
    EXPECT(hero_ril_wait(twice, 2, 0), HERO_RIL_INVALID);
    EXPECT(hero_ril_wait(twice, SIZE_MAX / sizeof *twice, 0), HERO_RIL_INVALID);
    EXPECT(hero_ril_wait(twice, 0, 0), HERO_RIL_INVALID);

    hero_ril_topic own = {"status/state", NULL, "# Layout: a.A.v1\n\nuint64 sequence\nuint64 epoch_ns\n", 0};
    hero_ril_publisher *publisher;
    hero_ril_robot *bridge;
    EXPECT(hero_ril_advertise(robot, &own, &publisher), HERO_RIL_INVALID);
    EXPECT(hero_ril_join(NULL, 1, "bridge", &bridge), HERO_RIL_INVALID);

    EXPECT(hero_ril_request_slice(HERO_RIL_CONSUMER), HERO_RIL_OK);
    EXPECT(hero_ril_request_slice(3), HERO_RIL_INVALID);
}

/* Receives a sample of a publisher of this thread, which has to serve the subscriber meanwhile. */
static HeroTelemetry next(hero_ril_publisher *publisher, hero_ril_subscriber *subscriber) {
    HeroTelemetry sample;
    hero_ril_source sources[2] = {{.publisher = publisher}, {.subscriber = subscriber}};
    int result;
    while ((result = hero_ril_receive(subscriber, &sample, sizeof sample, 0)) == HERO_RIL_NOTHING) {
        EXPECT(hero_ril_wait(sources, 2, WATCHDOG_MS), HERO_RIL_OK);
    }
    EXPECT(result, HERO_RIL_OK);
    return sample;
}

/* A topic from a publisher to a subscriber. */
static void samples(void) {
    puts("samples");
    hero_ril_topic topic = hero_ril_hero_telemetry();
    hero_ril_subscriber *subscriber;
    hero_ril_publisher *publisher;
    HeroTelemetry sample;
    memset(&sample, 0, sizeof sample);
    sample.geodetic.altitude_m = 25.0;
    EXPECT(hero_ril_subscribe(robot, &topic, &subscriber), HERO_RIL_OK);
    EXPECT(hero_ril_advertise(robot, &topic, &publisher), HERO_RIL_OK);
    EXPECT(hero_ril_publish(publisher, &sample, sizeof sample, NULL), HERO_RIL_OK);
    sample = next(publisher, subscriber);
    if (sample.sequence != 1 || sample.geodetic.altitude_m != 25.0) {
        fputs("another sample came\n", stderr);
        exit(1);
    }
    hero_ril_unsubscribe(subscriber);
    hero_ril_withdraw(publisher);
}

static int is_near(double value, double expected, double margin) {
    return value > expected - margin && value < expected + margin;
}

/* Degrees, metres and UTC. */
static void places(void) {
    puts("places");
    HeroTelemetry sample;
    memset(&sample, 0, sizeof sample);
    sample.geodetic.latitude_rad = 0.65275;
    sample.geodetic.altitude_m = 25.0;
    hero_ril_waypoint here, there;
    hero_ril_offset offset = {300.0, 400.0, 5.0}, back;
    EXPECT(hero_ril_place_of(&sample, &here), HERO_RIL_OK);
    EXPECT(hero_ril_place_at(&here, &offset, &there), HERO_RIL_OK);
    EXPECT(hero_ril_offset_of(&here, &there, &back), HERO_RIL_OK);
    EXPECT(hero_ril_offset_of(&here, NULL, &back), HERO_RIL_INVALID);
    EXPECT(hero_ril_place_of(NULL, &here), HERO_RIL_INVALID);
    struct timespec mono, unix_time;
    clock_gettime(CLOCK_MONOTONIC, &mono);
    double utc_s = (double)hero_ril_utc_ns((uint64_t)mono.tv_sec * 1000000000u + (uint64_t)mono.tv_nsec) / 1e9;
    clock_gettime(CLOCK_REALTIME, &unix_time);
    if (!is_near(hero_ril_degrees(3.14159265358979), 180.0, 1e-6) || !is_near(here.latitude_deg, 37.3998, 1e-3) ||
        here.altitude_m != 25.0 || !is_near(back.north_m, 300.0, 1e-3) || !is_near(back.east_m, 400.0, 1e-3) ||
        hero_ril_utc_ns(0) != 0 || !is_near(utc_s, (double)unix_time.tv_sec, 60.0)) {
        fputs("another place or moment\n", stderr);
        exit(1);
    }
    /* An array is a path; the one waypoint is sent without an answer. */
    hero_ril_waypoint path[1] = {there};
    uint64_t id;
    EXPECT(hero_ril_go_to(client, path, sizeof path / sizeof *path, 0, &id), HERO_RIL_OK);
    MovementData request;
    uint64_t ticket;
    EXPECT(hero_ril_take(server, &request, sizeof request, &ticket, WATCHDOG_MS), HERO_RIL_OK);
    EXPECT(request.after, 0);
    if (request.latitude_deg != there.latitude_deg || request.longitude_deg != there.longitude_deg ||
        request.altitude_m != there.altitude_m || request.first != 1 || request.last != 1 || request.request_id != id) {
        fputs("another waypoint came\n", stderr);
        exit(1);
    }
    EXPECT(hero_ril_answer(server, ticket, HERO_STAGE_DONE, HERO_REASON_NONE), HERO_RIL_OK);
    /* A step behind it, and what comes then is none. */
    uint64_t before[2] = {id, 0};
    EXPECT(hero_ril_follow(client, id), HERO_RIL_OK);
    for (int i = 0; i < 2; i++) {
        EXPECT(hero_ril_land(client, 0, NULL), HERO_RIL_OK);
        EXPECT(hero_ril_take(server, &request, sizeof request, &ticket, WATCHDOG_MS), HERO_RIL_OK);
        if (request.after != before[i]) {
            fputs("another step before\n", stderr);
            exit(1);
        }
        EXPECT(hero_ril_answer(server, ticket, HERO_STAGE_DONE, HERO_REASON_NONE), HERO_RIL_OK);
    }
}

/* Closes what is open: in a child that was forked as well, when it ends. */
static void leave(void) {
    hero_ril_client_close(client);
    hero_ril_server_close(server);
    hero_ril_leave(robot);
    client = NULL;
    server = NULL;
    robot = NULL;
}

/* What a child calls with its parent's handles. */
static void in_child(hero_ril_publisher *publisher, hero_ril_subscriber *subscriber) {
    HeroTelemetry sample;
    RequestReport report;
    uint64_t ticket;
    MovementData request;
    hero_ril_source source = {.subscriber = subscriber};
    memset(&sample, 0, sizeof sample);
    EXPECT(hero_ril_publish(publisher, &sample, sizeof sample, NULL), HERO_RIL_FAILED);
    if (strstr(hero_ril_last_error(), "forked") == NULL) {
        fprintf(stderr, "the error does not name the fork: %s\n", hero_ril_last_error());
        exit(1);
    }
    EXPECT(hero_ril_hold(client, NULL), HERO_RIL_FAILED);
    EXPECT(hero_ril_next_report(client, 0, -1, &report), HERO_RIL_FAILED);
    EXPECT(hero_ril_take(server, &request, sizeof request, &ticket, -1), HERO_RIL_FAILED);
    EXPECT(hero_ril_receive(subscriber, &sample, sizeof sample, -1), HERO_RIL_FAILED);
    EXPECT(hero_ril_wait(&source, 1, -1), HERO_RIL_FAILED);
    hero_ril_unsubscribe(subscriber);
    hero_ril_withdraw(publisher);
    leave();

    EXPECT(hero_ril_join(NULL, 1, "child", &robot), HERO_RIL_FAILED);
    if (strstr(hero_ril_last_error(), "forked") == NULL) {
        fprintf(stderr, "the error does not name the fork: %s\n", hero_ril_last_error());
        exit(1);
    }
}

/* A child that uses its parent's handles, closes them and returns from main does its parent no harm. */
static int is_forked(void) {
    hero_ril_topic topic = hero_ril_hero_telemetry();
    hero_ril_subscriber *subscriber;
    hero_ril_publisher *publisher;
    HeroTelemetry sample;
    int status = 0;
    puts("fork");
    memset(&sample, 0, sizeof sample);
    EXPECT(hero_ril_subscribe(robot, &topic, &subscriber), HERO_RIL_OK);
    EXPECT(hero_ril_advertise(robot, &topic, &publisher), HERO_RIL_OK);
    EXPECT(hero_ril_publish(publisher, &sample, sizeof sample, NULL), HERO_RIL_OK);
    EXPECT(next(publisher, subscriber).sequence, 1);
    pid_t child = fork();
    if (child == 0) {
        in_child(publisher, subscriber);
        return 1;
    }
    EXPECT(waitpid(child, &status, 0), child);
    EXPECT(status, 0);
    EXPECT(hero_ril_publish(publisher, &sample, sizeof sample, NULL), HERO_RIL_OK);
    EXPECT(next(publisher, subscriber).sequence, 2);
    EXPECT(hero_ril_hold(client, NULL), HERO_RIL_OK);
    serve_one();
    hero_ril_unsubscribe(subscriber);
    hero_ril_withdraw(publisher);
    return 0;
}

int main(void) {
    atexit(leave);
    setvbuf(stdout, NULL, _IOLBF, 0);
    hero_ril_service movement = hero_ril_movement();
    EXPECT(hero_ril_join(NULL, 1, "clients", &robot), HERO_RIL_OK);
    EXPECT(hero_ril_serve(robot, &movement, &server), HERO_RIL_OK);
    EXPECT(hero_ril_client_open(robot, &client), HERO_RIL_OK);
    orders();
    idle();
    wrong();
    samples();
    places();
    if (is_forked()) {
        return 0;
    }
    puts("passed");
    return 0;
}
