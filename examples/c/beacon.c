/* A module in C: `ril start --module beacon` makes it blink, `ril stop --module beacon` ends that; a request sets how often.
 *
 * Build it as bindings/c/README.md says. It ends in order with Ctrl+C and SIGTERM.
 */
#include <stdio.h>

#include "hero_ril.h"

/* The request: begins with `request_id`, has no padding. */
typedef struct SetPeriod {
    uint64_t request_id;
    double period_s;
} SetPeriod;

static const char SCHEMA[] = "# Layout: beacon.SetPeriod.v1\n\nuint64 request_id\nfloat64 period_s\n";
static const hero_ril_service PERIOD = {"beacon/period", NULL, SCHEMA, sizeof(SetPeriod)};

enum { BLINKING = 1 };

static int fail(void) {
    fprintf(stderr, "beacon: %s\n", hero_ril_last_error());
    return 1;
}

/* Takes every request that is there. */
static int serve(hero_ril_server *server, double *period_s) {
    SetPeriod request;
    uint64_t ticket;
    int result;
    while ((result = hero_ril_take(server, &request, sizeof request, &ticket, 0)) == HERO_RIL_OK) {
        if (request.period_s >= 0.01 && request.period_s <= 10.0) {
            *period_s = request.period_s;
            printf("period %.2f s\n", *period_s);
            result = hero_ril_answer(server, ticket, HERO_STAGE_DONE, HERO_REASON_NONE);
        } else {
            result = hero_ril_answer(server, ticket, HERO_STAGE_REFUSED, HERO_REASON_OUT_OF_RANGE);
        }
        if (result < 0) {
            break;
        }
    }
    return result;
}

static int run(hero_ril_module *module, hero_ril_server *server) {
    hero_ril_source source = {.server = server};
    double period_s = 0.5;
    for (;;) {
        int event = hero_ril_module_wait(module, &source, 1, (int32_t)(period_s * 1000.0));
        switch (event) {
        case HERO_RIL_STARTED:
            hero_ril_module_begin(module, BLINKING, "blinking", HERO_RIL_ENDS);
            break;
        case HERO_RIL_STOPPED:
            puts("dark");
            break;
        case HERO_RIL_NOTHING:
            if (hero_ril_module_is_started(module)) {
                puts("blink");
            }
            break;
        case HERO_RIL_ENDING:
            return HERO_RIL_OK;
        default:
            if (event < 0) {
                return event;
            }
        }
        if (serve(server, &period_s) < 0) {
            return HERO_RIL_FAILED;
        }
        fflush(stdout);
    }
}

int main(void) {
    hero_ril_robot *robot = NULL;
    hero_ril_module *module = NULL;
    hero_ril_server *server = NULL;
    int result = 0;
    if (hero_ril_join(NULL, 1, "beacon", &robot) < 0 || hero_ril_module_open(robot, "beacon", 1002, 1, &module) < 0 ||
        hero_ril_module_serve(robot, &PERIOD, &server) < 0 || run(module, server) < 0) {
        result = fail();
    }
    hero_ril_server_close(server);
    hero_ril_module_close(module);
    hero_ril_leave(robot);
    return result;
}
