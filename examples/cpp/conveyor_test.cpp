// The counter of ../c/conveyor_test.c in C++17, and its test with the fixtures of hero_ril_testing.h alone.
#include <cmath>
#include <iostream>
#include <vector>

#include <hero_ril.hpp>
#include <hero_ril_testing.h>

using namespace std::chrono_literals;

struct Belt {
    std::uint64_t sequence;
    std::uint64_t epoch_ns;
    double speed_mps;
    double moved_m;
};

HERO_RIL_TOPIC(Belt, "conveyor/belt", R"(# Layout: conveyor.Belt.v1

uint64 sequence
uint64 epoch_ns
float64 speed_mps
float64 moved_m
)");

struct SetSpeed {
    std::uint64_t request_id;
    double speed_mps;
};

HERO_RIL_REQUEST(SetSpeed, "conveyor/speed", R"(# Layout: conveyor.SetSpeed.v1

uint64 request_id
float64 speed_mps
)");

namespace {

// Waits until the belt has moved so far, and says how many samples that took.
int samples_until(hero_ril::Subscriber<Belt> &belt, double metres) {
    int samples = 0;
    while (auto sample = belt.receive(10s)) {
        ++samples;
        if (sample->moved_m >= metres) {
            return samples;
        }
    }
    return -1;
}

void the_counter_loses_nothing_of_a_script_that_is_longer_than_a_queue(hero_ril::Robot &robot) {
    std::vector<Belt> script(1000);
    for (std::size_t step = 0; step < script.size(); ++step) {
        script[step] = {0, 0, 2.0, 0.04 * static_cast<double>(step)};
    }
    auto belt = robot.subscribe<Belt>();
    auto topic = hero_ril::TopicOf<Belt>::get();
    hero_ril_testing_topic stand_in;
    hero_ril_testing_play(&stand_in, &topic, script.data(), script.size());
    HERO_RIL_CHECK(samples_until(belt, script.back().moved_m) == 1000);
    hero_ril_testing_finish(&stand_in);
    HERO_RIL_CHECK(belt.losses().lost == 0);
}

// Refuses the first request, and dies of the second.
int answer(hero_ril_server *server, std::uint64_t ticket, const void *, std::size_t index, void *) {
    if (index == 0) {
        hero_ril_answer(server, ticket, HERO_STAGE_REFUSED, HERO_REASON_BUSY);
    }
    return index == 0;
}

void a_client_learns_of_a_drive_that_refuses_or_dies(hero_ril::Robot &robot) {
    auto service = hero_ril::RequestOf<SetSpeed>::get();
    hero_ril_testing_server stand_in;
    hero_ril_testing_serve(&stand_in, &service, answer, nullptr);
    auto client = robot.client();
    for (auto stage : {HERO_STAGE_REFUSED, HERO_STAGE_UNKNOWN}) {
        try {
            client.send(SetSpeed{0, 1.0}).finish();
            HERO_RIL_CHECK(!"it is done");
        } catch (const hero_ril::RequestFailed &failed) {
            HERO_RIL_CHECK(failed.report().stage == static_cast<std::uint32_t>(stage));
        }
    }
    hero_ril_testing_stop(&stand_in);
}

} // namespace

int main() {
    hero_ril_testing_domain domain;
    hero_ril_testing_begin(&domain);
    {
        hero_ril::Robot robot("conveyor");
        the_counter_loses_nothing_of_a_script_that_is_longer_than_a_queue(robot);
        a_client_learns_of_a_drive_that_refuses_or_dies(robot);
    }
    hero_ril_testing_end(&domain, 0);
    std::cout << "ok" << std::endl;
}
