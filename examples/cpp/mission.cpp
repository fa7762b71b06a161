/* Takes off, flies a path of two points and lands, and prints what the robot says meanwhile: mission [ALTITUDE_M] */
#include <cstdlib>
#include <iostream>

#include <hero_ril.hpp>

using namespace std::chrono_literals;

int main(int argc, char **argv) try {
    const double altitude_m = argc > 1 ? std::atof(argv[1]) : 10.0;
    hero_ril::Robot robot("cpp-mission");
    auto telemetry = robot.subscribe<HeroTelemetry>();
    auto client = robot.client();
    const auto here = telemetry.receive(5s);
    if (!here) {
        std::cerr << "no telemetry: start `ril run status`\n";
        return 1;
    }

    const auto follow = [&](const char *what, hero_ril::Request request) {
        request.finish([&](const RequestReport &report) {
            std::cout << what << ": " << hero_ril_stage_name(report.stage) << '\n';
            if (const auto sample = telemetry.latest()) {
                std::cout << sample->sequence << ' ' << sample->geodetic.altitude_m << " m, flying " << sample->flying << '\n';
            }
        });
        return request;
    };
    // Telemetry is in SI units, waypoints are in degrees; 0.0001 degrees of latitude are 11 m.
    constexpr double DEG_PER_RAD = 57.29577951308232;
    const auto &from = here->geodetic;
    const hero_ril::Waypoint above{from.latitude_rad * DEG_PER_RAD, from.longitude_rad * DEG_PER_RAD, from.altitude_m + altitude_m};
    const hero_ril::Waypoint north{above.latitude_deg + 1e-4, above.longitude_deg, above.altitude_m};
    // Each is a step behind the one before: not taken when somebody else has ordered something meanwhile.
    const auto start = follow("start", client.start());
    const auto take_off = follow("take off", client.after(start).take_off(altitude_m));
    const auto go_to = follow("go to", client.after(take_off).go_to({north, above}));
    follow("land", client.after(go_to).land());
    return 0;
} catch (const std::exception &error) {
    std::cerr << error.what() << '\n';
    return 1;
}
