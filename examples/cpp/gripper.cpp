// The module and the program of ../c/gripper.c in C++17:
//
//     gripper serve            opens and closes until SIGINT or SIGTERM
//     gripper move WIDTH_M     exit code 0 when the gripper is there
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <string>

#include <hero_ril.hpp>

using namespace std::chrono_literals;

// The request: begins with `request_id`, has no padding.
struct Move {
    std::uint64_t request_id;
    double width_m;
};

HERO_RIL_REQUEST(Move, "gripper/move", R"(# Moves the fingers apart, or together.
#
# Layout: gripper.Move.v1

# Chosen by the sender; every report repeats it.
uint64 request_id
# Distance of the fingers. [m]
float64 width_m
)");

namespace {

constexpr double WIDEST_M = 0.1;
constexpr double STEP_M = 0.001;
constexpr auto STEP = 10ms;

volatile std::sig_atomic_t is_ended = 0;

// One step towards `to_m`.
double step(double width_m, double to_m) {
    double left_m = to_m - width_m;
    return std::abs(left_m) <= STEP_M ? to_m : width_m + std::copysign(STEP_M, left_m);
}

void serve(hero_ril::Robot &robot) {
    auto server = robot.serve<Move>();
    for (int number : {SIGINT, SIGTERM}) {
        std::signal(number, [](int) { is_ended = 1; });
    }
    std::cout << "serving" << std::endl;
    std::optional<hero_ril::Order<Move>> current;
    double width_m = 0;
    while (is_ended == 0) {
        auto order = server.take(current ? STEP : 1000ms);
        for (auto ticket : server.vanished()) {
            if (current && current->ticket() == ticket) {
                current->close();
            }
        }
        if (order && current) {
            order->refuse(HERO_REASON_BUSY);
        } else if (order && !((*order)->width_m >= 0 && (*order)->width_m <= WIDEST_M)) {
            order->refuse(HERO_REASON_OUT_OF_RANGE);
        } else if (order) {
            order->accept();
            current = std::move(order);
        } else if (current && current->is_open()) {
            width_m = step(width_m, (*current)->width_m);
            RequestReport report{};
            report.stage = width_m == (*current)->width_m ? HERO_STAGE_DONE : HERO_STAGE_PROGRESS;
            report.value = width_m;
            report.value_valid = 1;
            if (current->report(report) && !current->is_open()) {
                current.reset();
            }
        }
        if (current && !current->is_open()) {
            current.reset();
            std::cout << "given up" << std::endl;
        }
    }
}

void move(hero_ril::Robot &robot, double width_m) {
    auto client = robot.client();
    client.send(Move{0, width_m}).finish([](const RequestReport &report) {
        std::cout << hero_ril_stage_name(report.stage) << ": " << report.value << " m" << std::endl;
    });
}

} // namespace

int main(int argc, char **argv) {
    if (argc < 2) {
        std::cerr << "gripper serve | gripper move WIDTH_M\n";
        return 2;
    }
    try {
        hero_ril::Robot robot("gripper-cpp");
        if (std::string(argv[1]) == "serve") {
            serve(robot);
        } else {
            move(robot, argc > 2 ? std::atof(argv[2]) : 0.05);
        }
        return 0;
    } catch (const std::exception &error) {
        std::cerr << error.what() << "\n";
        return 1;
    }
}
