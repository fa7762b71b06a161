/* A topic of a module of our own: its struct, its schema, a publisher and a consumer.
 *
 *     voltages publish COUNT     publishes so many samples, ten a second
 *     voltages print COUNT       prints so many samples
 *
 * `ril echo battery_watch/cell_voltages` prints them as well: the schema lies beside the topic.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <hero_ril.h>

typedef struct Voltages {
    uint64_t sequence; /* The library fills in these two. */
    uint64_t epoch_ns;
    float cells[12];
} Voltages;

/* The same struct in ROS 2's message format. Fields follow one another without a hole. */
static const char SCHEMA[] = "# Voltages of the flight battery.\n"
                             "#\n"
                             "# Layout: battery_watch.Voltages.v1\n"
                             "\n"
                             "uint64 sequence\n"
                             "uint64 epoch_ns\n"
                             "# Of the cells, from the negative pole, under load. [V]\n"
                             "float32[12] cells\n";

static const hero_ril_topic TOPIC = {"battery_watch/cell_voltages", NULL, SCHEMA, sizeof(Voltages)};

static int fail(const char *what) {
    fprintf(stderr, "%s: %s\n", what, hero_ril_last_error());
    return 1;
}

static int publish(hero_ril_robot *robot, long count) {
    hero_ril_publisher *publisher;
    if (hero_ril_advertise(robot, &TOPIC, &publisher) != HERO_RIL_OK) {
        return fail("advertise");
    }
    hero_ril_source source = {.publisher = publisher};
    for (long number = 0; number < count; number++) {
        Voltages voltages = {0};
        for (int cell = 0; cell < 12; cell++) {
            voltages.cells[cell] = 3.7f + 0.01f * (float)cell;
        }
        if (hero_ril_publish(publisher, &voltages, sizeof voltages, NULL) != HERO_RIL_OK) {
            return fail("publish");
        }
        /* A subscriber that joins now gets the latest sample at once. */
        if (hero_ril_wait(&source, 1, 100) < 0) {
            return fail("wait");
        }
    }
    hero_ril_withdraw(publisher);
    return 0;
}

static int print(hero_ril_robot *robot, long count) {
    hero_ril_subscriber *subscriber;
    if (hero_ril_subscribe(robot, &TOPIC, &subscriber) != HERO_RIL_OK) {
        return fail("subscribe");
    }
    puts("subscribed");
    fflush(stdout);
    Voltages voltages;
    for (long number = 0; number < count; number++) {
        int result = hero_ril_receive(subscriber, &voltages, sizeof voltages, -1);
        if (result != HERO_RIL_OK) {
            return fail("receive");
        }
        printf("%" PRIu64 " %.2f V to %.2f V\n", voltages.sequence, voltages.cells[0], voltages.cells[11]);
        fflush(stdout);
    }
    hero_ril_unsubscribe(subscriber);
    return 0;
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: %s publish|print COUNT\n", argv[0]);
        return 2;
    }
    hero_ril_robot *robot;
    if (hero_ril_join(NULL, 1, "c-voltages", &robot) != HERO_RIL_OK) {
        return fail("join");
    }
    int result = (strcmp(argv[1], "publish") == 0 ? publish : print)(robot, atol(argv[2]));
    hero_ril_leave(robot);
    return result;
}
