// Whether two encoders on one drive train agree: what one has turned more than the other, less the twist
// that the torque between them explains, stays within a window of backlash and friction. A declared stiffness is
// believed to a part only, and an encoder may be read late. Whole numbers.
#pragma once

#include <cstdint>

#include "crossing.hpp"

namespace rig {

struct PairLimits {
    std::int32_t first_per_turn = 0;   // counts, signed, for the same turn of the train;
    std::int32_t second_per_turn = 0;  // either 0 where the two are not compared
    std::int32_t twist_e6 = 0;         // counts of the first, signed, for 1e6 counts of torque
    std::int32_t window = 0;           // counts of the first, from end to end
    std::int32_t late_ticks = 0;       // how old the first's count may be
    std::int32_t mean_ticks = 1;       // over which the slack is averaged: a ringing cable swings beyond its twist
};

// What the torque between two encoders twists them by, counts of the first.
inline std::int64_t twist_of(const PairLimits& limits, std::int32_t torque) {
    return std::int64_t{torque} * limits.twist_e6 / 1000000;
}

class EncoderPair {
  public:
    // Since it began, the slack between both has spanned at most the window; `channel` is the first's.
    Crossing check(const PairLimits& limits, std::int32_t first, std::int32_t second,
                   std::int32_t torque, std::uint8_t channel) {
        if (limits.first_per_turn == 0 || limits.second_per_turn == 0) return {};
        const std::int64_t twist = twist_of(limits, torque);
        const std::int64_t slack = (first - twist) * limits.second_per_turn -
                                   std::int64_t{second} * limits.first_per_turn;
        const std::int64_t scale = magnitude(limits.second_per_turn);
        const std::int64_t doubt = magnitude(twist) / kDoubt * scale +
                                   speed(second) * limits.late_ticks / kFine *
                                       magnitude(limits.first_per_turn);
        if (!primed_) sum_ = slack * limits.mean_ticks;
        sum_ += slack - sum_ / limits.mean_ticks;
        const std::int64_t mean = sum_ / limits.mean_ticks;
        if (!primed_ || mean + doubt < least_) least_ = mean + doubt;
        if (!primed_ || mean - doubt > most_) most_ = mean - doubt;
        primed_ = true;
        const std::int64_t span = most_ < least_ ? 0 : (most_ - least_) / scale;
        if (!exceeds(span, limits.window)) return {};
        return {kEncodersDisagree, channel, span, limits.window, 0};
    }

  private:
    static constexpr std::int64_t kFine = 256;  // parts of a count
    static constexpr std::int64_t kSpeedTicks = 16;
    static constexpr std::int64_t kFastest = 1 << 20;  // what no product above can overflow with

    // Mean of the second's steps, parts of a count.
    std::int64_t speed(std::int32_t second) {
        if (!primed_) last_ = second;
        std::int64_t step = std::int64_t{second} - last_;
        last_ = second;
        if (step > kFastest) step = kFastest;
        if (step < -kFastest) step = -kFastest;
        speed_ += (kFine * step - speed_) / kSpeedTicks;
        return magnitude(speed_);
    }

    std::int64_t least_ = 0;
    std::int64_t most_ = 0;
    std::int64_t sum_ = 0;  // of the slack over the mean's ticks
    std::int64_t speed_ = 0;
    std::int32_t last_ = 0;
    bool primed_ = false;
};

}  // namespace rig
