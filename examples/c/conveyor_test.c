/* A program about a conveyor belt, and its test with the fixtures of hero_ril_testing.h alone: a counter that reads the belt, a drive that
 * serves its speed. No helicopter is in it. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>

#include <hero_ril.h>
#include <hero_ril_testing.h>

typedef struct Belt {
    uint64_t sequence;
    uint64_t epoch_ns;
    double speed_mps;
    double moved_m;
} Belt;

typedef struct SetSpeed {
    uint64_t request_id;
    double speed_mps;
} SetSpeed;

static const hero_ril_topic BELT = {
    .key = "conveyor/belt",
    .schema = "# Layout: conveyor.Belt.v1\n\nuint64 sequence\nuint64 epoch_ns\nfloat64 speed_mps\nfloat64 moved_m\n",
    .size = sizeof(Belt),
};
static const hero_ril_service SPEED = {
    .key = "conveyor/speed",
    .schema = "# Layout: conveyor.SetSpeed.v1\n\nuint64 request_id\nfloat64 speed_mps\n",
    .size = sizeof(SetSpeed),
};

/* The program under test: waits until the belt has moved so far, over restarts of its drive; -1 when it stands still. */
static int64_t wait_for_metres(hero_ril_subscriber *belt, double metres) {
    double moved_m = 0, before_m = 0;
    int64_t samples = 0;
    while (moved_m < metres) {
        Belt sample;
        if (hero_ril_receive(belt, &sample, sizeof sample, 10000) != HERO_RIL_OK) {
            return -1;
        }
        ++samples;
        /* What is no number is a fault of the drive; what goes back is its new beginning. */
        if (isfinite(sample.moved_m)) {
            moved_m += fmax(0, sample.moved_m - before_m);
            before_m = sample.moved_m;
        }
    }
    return samples;
}

/* The program under test: serves the speed. Here the stand-in's thread runs it. */
static int drive(hero_ril_server *server, uint64_t ticket, const void *request, size_t index, void *context) {
    SetSpeed set;
    (void)index;
    memcpy(&set, request, sizeof set);
    if (set.speed_mps >= 0 && set.speed_mps <= 3) {
        *(double *)context = set.speed_mps;
        hero_ril_answer(server, ticket, HERO_STAGE_DONE, HERO_REASON_NONE);
    } else {
        hero_ril_answer(server, ticket, HERO_STAGE_REFUSED, HERO_REASON_OUT_OF_RANGE);
    }
    return 1;
}

/* Hangs, then dies. */
static int faulty(hero_ril_server *server, uint64_t ticket, const void *request, size_t index, void *context) {
    (void)server, (void)ticket, (void)request, (void)context;
    return index == 0;
}

enum { SAMPLES = 1000 };
static Belt script[SAMPLES];

static void the_counter_loses_nothing_of_a_script_that_is_longer_than_a_queue(hero_ril_robot *robot) {
    hero_ril_subscriber *belt;
    hero_ril_testing_topic topic;
    HERO_RIL_CHECK(hero_ril_subscribe(robot, &BELT, &belt) == HERO_RIL_OK);
    hero_ril_testing_play(&topic, &BELT, script, SAMPLES);
    HERO_RIL_CHECK(wait_for_metres(belt, script[SAMPLES - 1].moved_m) == SAMPLES);
    hero_ril_testing_finish(&topic);
    hero_ril_testing_nothing_lost(belt);
    /* The drive begins again, and says things of any bit pattern in between. */
    static Belt again[SAMPLES];
    memcpy(again, script, sizeof again);
    hero_ril_testing_garbage(7, &again[100], 50 * sizeof(Belt));
    hero_ril_testing_play(&topic, &BELT, again, SAMPLES);
    HERO_RIL_CHECK(wait_for_metres(belt, 30) > 0);
    Belt sample;
    while (hero_ril_receive(belt, &sample, sizeof sample, 1000) == HERO_RIL_OK) {
    }
    hero_ril_testing_finish(&topic);
    hero_ril_unsubscribe(belt);
}

static void requests_end_once_whatever_the_drive_does(hero_ril_robot *robot) {
    double speed_mps = 0;
    hero_ril_testing_server server;
    hero_ril_client *client;
    uint64_t id;
    HERO_RIL_CHECK(hero_ril_client_open(robot, &client) == HERO_RIL_OK);
    hero_ril_testing_serve(&server, &SPEED, drive, &speed_mps);
    const double speeds[] = {1.5, 9.0, NAN};
    for (size_t index = 0; index < 3; ++index) {
        SetSpeed set = {0, speeds[index]};
        HERO_RIL_CHECK(hero_ril_send(client, &SPEED, &set, sizeof set, &id) == HERO_RIL_OK);
        RequestReport report = hero_ril_testing_final(client, id);
        HERO_RIL_CHECK(report.stage == (index == 0 ? HERO_STAGE_DONE : HERO_STAGE_REFUSED));
    }
    hero_ril_testing_stop(&server);
    HERO_RIL_CHECK(speed_mps == 1.5);

    hero_ril_testing_serve(&server, &SPEED, faulty, NULL);
    SetSpeed set = {0, 1.0};
    RequestReport report;
    HERO_RIL_CHECK(hero_ril_send(client, &SPEED, &set, sizeof set, &id) == HERO_RIL_OK);
    HERO_RIL_CHECK(hero_ril_next_report(client, id, 50, &report) == HERO_RIL_NOTHING);
    HERO_RIL_CHECK(hero_ril_send(client, &SPEED, &set, sizeof set, &id) == HERO_RIL_OK);
    HERO_RIL_CHECK(hero_ril_testing_final(client, id).stage == HERO_STAGE_UNKNOWN);
    hero_ril_testing_stop(&server);
    hero_ril_client_close(client);
}

int main(void) {
    hero_ril_testing_domain domain;
    hero_ril_robot *robot;
    for (int step = 0; step < SAMPLES; ++step) {
        script[step].speed_mps = 2;
        script[step].moved_m = 0.04 * step;
    }
    hero_ril_testing_begin(&domain);
    HERO_RIL_CHECK(hero_ril_join(NULL, 1, "conveyor", &robot) == HERO_RIL_OK);
    the_counter_loses_nothing_of_a_script_that_is_longer_than_a_queue(robot);
    requests_end_once_whatever_the_drive_does(robot);
    hero_ril_leave(robot);
    hero_ril_testing_end(&domain, 0);
    puts("ok");
    return 0;
}
