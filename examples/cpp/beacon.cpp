/* beacon.c in C++: a module that `ril start --module beacon` makes blink; a request sets how often. */
#include <iomanip>
#include <iostream>

#include <hero_ril.hpp>

using namespace std::chrono_literals;

/* The request: begins with `request_id`, has no padding. */
struct SetPeriod {
    std::uint64_t request_id;
    double period_s;
};
HERO_RIL_REQUEST(SetPeriod, "beacon/period", "# Layout: beacon.SetPeriod.v1\n\nuint64 request_id\nfloat64 period_s\n");

int main() try {
    constexpr std::uint32_t BLINKING = 1;
    hero_ril::Robot robot("beacon");
    auto module = robot.module("beacon", 1002);
    auto periods = module.serve<SetPeriod>();
    hero_ril::Milliseconds period = 500ms;
    for (;;) {
        switch (module.wait(period, periods)) {
        case HERO_RIL_STARTED:
            module.begin(BLINKING, "blinking", HERO_RIL_ENDS);
            break;
        case HERO_RIL_STOPPED:
            std::cout << "dark" << std::endl;
            break;
        case HERO_RIL_NOTHING:
            if (module.is_started()) {
                std::cout << "blink" << std::endl;
            }
            break;
        case HERO_RIL_ENDING:
            return 0;
        default:
            break;
        }
        while (auto order = periods.take(0ms)) {
            const double period_s = (*order)->period_s;
            if (period_s >= 0.01 && period_s <= 10.0) {
                period = hero_ril::Milliseconds(static_cast<int>(period_s * 1000.0));
                std::cout << "period " << std::fixed << std::setprecision(2) << period_s << " s" << std::endl;
                order->done();
            } else {
                order->refuse(HERO_REASON_OUT_OF_RANGE);
            }
        }
    }
} catch (const std::exception &error) {
    std::cerr << "beacon: " << error.what() << '\n';
    return 1;
}
