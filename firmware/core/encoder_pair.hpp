// Whether two encoders on one drive train agree: what one has turned more than the other, less the twist
// that the torque between them explains, stays within a window of backlash and friction. Whole numbers.
#pragma once

#include <cstdint>

#include "crossing.hpp"

namespace rig {

struct PairLimits {
    std::int32_t first_per_turn = 0;   // counts, signed, for the same turn of the train;
    std::int32_t second_per_turn = 0;  // either 0 where the two are not compared
    std::int32_t twist_e6 = 0;         // counts of the first, signed, for 1e6 counts of torque
    std::int32_t window = 0;           // counts of the first, from end to end
};

class EncoderPair {
  public:
    // Since it began, the slack between both has spanned at most the window; `channel` is the first's.
    Crossing check(const PairLimits& limits, std::int32_t first, std::int32_t second,
                   std::int32_t torque, std::uint8_t channel) {
        if (limits.first_per_turn == 0 || limits.second_per_turn == 0) return {};
        const std::int64_t twist = std::int64_t{torque} * limits.twist_e6 / 1000000;
        const std::int64_t slack = (first - twist) * limits.second_per_turn -
                                   std::int64_t{second} * limits.first_per_turn;
        if (!primed_) {
            primed_ = true;
            least_ = most_ = slack;
        }
        if (slack < least_) least_ = slack;
        if (slack > most_) most_ = slack;
        const std::int64_t scale = magnitude(limits.second_per_turn);
        const std::int64_t span = (most_ - least_) / scale;
        if (!exceeds(span, limits.window)) return {};
        return {kEncodersDisagree, channel, span, limits.window, 0};
    }

  private:
    std::int64_t least_ = 0;
    std::int64_t most_ = 0;
    bool primed_ = false;
};

}  // namespace rig
