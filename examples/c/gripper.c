/* A module in C that serves a request of its own, and a program that sends it.
 *
 *     gripper serve            opens and closes until SIGINT or SIGTERM
 *     gripper move WIDTH_M     exit code 0 when the gripper is there
 */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hero_ril.h>

/* The request: begins with `request_id`, has no padding. */
typedef struct Move {
    uint64_t request_id;
    double width_m;
} Move;

static const hero_ril_service MOVE = {
    .key = "gripper/move",
    .schema = "# Moves the fingers apart, or together.\n"
              "#\n"
              "# Layout: gripper.Move.v1\n"
              "\n"
              "# Chosen by the sender; every report repeats it.\n"
              "uint64 request_id\n"
              "# Distance of the fingers. [m]\n"
              "float64 width_m\n",
    .size = sizeof(Move),
};

#define WIDEST_M 0.1
#define STEP_M 0.001
#define STEP_MS 10

static volatile sig_atomic_t is_ended;

static void end(int number) {
    (void)number;
    is_ended = 1;
}

static int fail(const char *what) {
    fprintf(stderr, "%s: %s\n", what, hero_ril_last_error());
    return 1;
}

/* One step towards `to_m`. */
static double step(double width_m, double to_m) {
    double left_m = to_m - width_m;
    return fabs(left_m) <= STEP_M ? to_m : width_m + copysign(STEP_M, left_m);
}

static int serve(hero_ril_robot *robot) {
    hero_ril_server *server;
    if (hero_ril_serve(robot, &MOVE, &server) != HERO_RIL_OK) {
        return fail("serve");
    }
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = end;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    puts("serving");
    fflush(stdout);

    int is_moving = 0, result = HERO_RIL_OK;
    uint64_t current = 0;
    double width_m = 0, to_m = 0;
    while (!is_ended && result >= 0) {
        Move move;
        uint64_t ticket;
        result = hero_ril_take(server, &move, sizeof move, &ticket, is_moving ? STEP_MS : 1000);
        if (result == HERO_RIL_OK && is_moving) {
            hero_ril_answer(server, ticket, HERO_STAGE_REFUSED, HERO_REASON_BUSY);
        } else if (result == HERO_RIL_OK && !(move.width_m >= 0 && move.width_m <= WIDEST_M)) {
            hero_ril_answer(server, ticket, HERO_STAGE_REFUSED, HERO_REASON_OUT_OF_RANGE);
        } else if (result == HERO_RIL_OK) {
            is_moving = 1;
            current = ticket;
            to_m = move.width_m;
            hero_ril_answer(server, current, HERO_STAGE_ACCEPTED, HERO_REASON_NONE);
        } else if (result == HERO_RIL_GONE && is_moving && ticket == current) {
            is_moving = 0;
            puts("given up");
            fflush(stdout);
        } else if (result == HERO_RIL_NOTHING && is_moving) {
            width_m = step(width_m, to_m);
            is_moving = width_m != to_m;
            RequestReport report;
            memset(&report, 0, sizeof report);
            report.stage = is_moving ? HERO_STAGE_PROGRESS : HERO_STAGE_DONE;
            report.value = width_m;
            report.value_valid = 1;
            if (hero_ril_report(server, current, &report) == HERO_RIL_GONE) {
                is_moving = 0;
                puts("given up");
                fflush(stdout);
            }
        }
    }
    if (result < 0) {
        fail("take");
    }
    hero_ril_server_close(server);
    return result < 0;
}

static int move(hero_ril_robot *robot, double width_m) {
    hero_ril_client *client;
    Move request = {0, width_m};
    uint64_t id;
    int code = 1;
    if (hero_ril_client_open(robot, &client) != HERO_RIL_OK) {
        return fail("client");
    }
    if (hero_ril_send(client, &MOVE, &request, sizeof request, &id) != HERO_RIL_OK) {
        fail("move");
    } else {
        RequestReport report;
        while (hero_ril_next_report(client, id, -1, &report) == HERO_RIL_OK) {
            printf("%s: %.3f m\n", hero_ril_stage_name(report.stage), report.value);
            if (hero_ril_is_final(&report)) {
                code = report.stage != HERO_STAGE_DONE;
                break;
            }
        }
    }
    hero_ril_client_close(client);
    return code;
}

int main(int argc, char **argv) {
    hero_ril_robot *robot;
    int code;
    if (argc < 2) {
        fprintf(stderr, "gripper serve | gripper move WIDTH_M\n");
        return 2;
    }
    if (hero_ril_join(NULL, 1, "gripper-c", &robot) != HERO_RIL_OK) {
        return fail("join");
    }
    code = strcmp(argv[1], "serve") == 0 ? serve(robot) : move(robot, argc > 2 ? atof(argv[2]) : 0.05);
    hero_ril_leave(robot);
    return code;
}
