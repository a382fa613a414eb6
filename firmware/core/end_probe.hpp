// Whether encoders that do not count are alive. A drive train that sticks and one whose encoders are all dead look
// alike until its friction is overcome, so the board asks: when nothing has counted for longer than it would take to
// reach the end of the travel that the motor is to turn towards, it pulls away from that end, harder than any friction.
// A sound train counts at once, which ends the pull; a dead one trips. Whole numbers: counts and ticks.
#pragma once

#include <cstdint>

#include "crossing.hpp"

namespace rig {

struct ProbeLimits {
    std::int32_t low = 0;  // ends of the followed encoder's travel
    std::int32_t high = 0;
    std::int32_t within = 0;            // counts from an end where patience is least
    std::int32_t patience = INT32_MAX;  // ticks more for 1000 counts farther; INT32_MAX to ask nowhere
    std::int32_t command_e4 = 0;        // that overcomes any friction and raises the followed count; 0 for none
};

class EndProbe {
  public:
    // Nothing has counted for `still_ticks`.
    Crossing check(std::int64_t tick_us, std::int64_t still_ticks) const {
        if (pull_ticks_ < kPullTicks || still_ticks < kPullTicks) return {};
        return {kEncoderFrozen, 0, 0, 1, still_ticks * tick_us};
    }

    // The command to give instead of the controller's.
    std::int32_t drive(const ProbeLimits& limits, std::int32_t target, std::int32_t followed,
                       std::int64_t still_ticks, std::int32_t command_e4) {
        const std::int64_t error = std::int64_t{target} - followed;
        const std::int64_t way = error != 0 ? error : std::int64_t{command_e4} * limits.command_e4;
        const std::int64_t left = way > 0 ? std::int64_t{limits.high} - followed
                                          : std::int64_t{followed} - limits.low;
        const std::int64_t farther = left > limits.within ? left - limits.within : 0;
        const std::int64_t patience = kLeastTicks + farther * limits.patience / 1000;
        const bool asks = limits.command_e4 != 0 && limits.patience != INT32_MAX && way != 0 &&
                          still_ticks >= (error != 0 ? patience : kAtTarget * patience);
        if (!asks) {
            pull_ticks_ = 0;
            return command_e4;
        }
        ++pull_ticks_;
        return way > 0 ? -limits.command_e4 : limits.command_e4;
    }

  private:
    static constexpr std::int64_t kLeastTicks = 30;
    static constexpr std::int64_t kAtTarget = 10;  // a train at its target is asked so much later
    static constexpr std::int64_t kPullTicks = 10;

    std::int64_t pull_ticks_ = 0;
};

}  // namespace rig
