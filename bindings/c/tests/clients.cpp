/* As clients.c, of what hero_ril.hpp adds. */
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <sys/wait.h>
#include <unistd.h>

#include "hero_ril.hpp"

using namespace std::chrono_literals;

static void expect(bool is_so, const char *what) {
    if (!is_so) {
        std::cerr << "not so: " << what << std::endl;
        std::exit(1);
    }
}

template <class Act> static hero_ril_result error_of(Act &&act) {
    try {
        act();
    } catch (const hero_ril::Error &error) {
        return error.code();
    }
    return HERO_RIL_OK;
}

int main() {
    hero_ril::Robot robot("clients");
    auto server = robot.serve<MovementData>();
    auto client = robot.client();
    auto serve_one = [&server] {
        auto order = server.take(60s);
        expect(order.has_value(), "a request");
        order->accept();
        order->done();
    };

    std::cout << "orders" << std::endl;
    for (int i = 0; i < 24; i++) {
        client.hold();
        serve_one();
    }
    auto hold = client.hold();
    serve_one();
    auto landing = client.after(hold).land();
    auto step = server.take(60s);
    expect(step.has_value() && (*step)->after == hold.id(), "a step behind the hold");
    step->accept();
    step->done();
    expect(landing.finish().stage == HERO_STAGE_DONE, "landed");

    std::cout << "fork" << std::endl;
    pid_t child = fork();
    if (child == 0) {
        bool is_error = error_of([&] { client.hold(); }) == HERO_RIL_FAILED;
        // Everything above is closed.
        return is_error ? 0 : 1;
    }
    int status = 0;
    expect(waitpid(child, &status, 0) == child && status == 0, "the child ended in order");
    auto after = client.hold();
    serve_one();
    expect(after.finish().stage == HERO_STAGE_DONE, "the parent goes on");

    std::cout << "requests that are over" << std::endl;
    auto given_up = client.hold();
    client.give_up();
    expect(error_of([&] { given_up.finish(); }) == HERO_RIL_INVALID, "no report can come");
    expect(error_of([&] { client.go_to({}); }) == HERO_RIL_INVALID, "no waypoint");

    std::cout << "places" << std::endl;
    hero_ril::LocalFrame frame({37.4, -6.0, 10.0});
    auto there = frame.place(300.0, 400.0, 5.0);
    auto back = frame.offset(there);
    expect(back.north_m > 299.999 && back.north_m < 300.001 && back.east_m > 399.999 && back.east_m < 400.001, "metres");
    HeroTelemetry sample{};
    sample.geodetic.altitude_m = 25.0;
    expect(hero_ril::place_of(sample).altitude_m == 25.0 && hero_ril::degrees(0.0) == 0.0, "a place");
    auto moment = hero_ril::utc(1);
    expect(!hero_ril::utc(0) && moment && *moment < std::chrono::system_clock::now(), "a moment");
    const std::array<hero_ril::Waypoint, 1> row{there};
    const hero_ril::Waypoint plain[1] = {there};
    auto by_array = client.go_to(row);
    serve_one();
    expect(by_array.finish().stage == HERO_STAGE_DONE, "an array is a path");
    auto by_plain_array = client.go_to(plain);
    serve_one();
    expect(by_plain_array.finish().stage == HERO_STAGE_DONE, "an array of C is a path");

    std::cout << "times" << std::endl;
    auto telemetry = robot.subscribe<HeroTelemetry>();
    expect(!telemetry.receive(-1ms) && !telemetry.receive(hero_ril::Milliseconds::min()), "nothing");
    expect(!server.take(-5ms) && !hero_ril::wait(-1h, telemetry), "nothing");
    hero_ril::request_slice(HERO_RIL_CONSUMER);
    std::cout << "passed" << std::endl;
    return 0;
}
