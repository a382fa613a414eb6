// The watch of one motor over time: over-speed, heat, stall. Whole numbers: counts and ticks. Also the heat
// alone, of a motor whose current is commanded and not measured.
#pragma once

#include <cstdint>

#include "crossing.hpp"
#include "limits.hpp"

namespace rig {

constexpr std::int64_t kOverSpeedTicks = 3;

// What a motor's current has left in its winding: the integral of its square above that of the current it can
// take for ever, counts^2 s. It is kept from one arming to the next and cools all the time.
class Heat {
  public:
    // Nothing is known of the time before a start, so a motor is as hot then as it may be.
    void assume_hot() { unknown_ticks_ = 0; }

    void take(std::int64_t continuous, std::int64_t tick_us, std::int64_t ticks, std::int32_t current) {
        if (unknown_ticks_ >= 0) unknown_ticks_ = least(unknown_ticks_ + ticks, kLongestTicks);
        const std::int64_t size = current == kMissing ? 0 : least(magnitude(current), kLargest);
        ticks_a_second_ = 1000000 / tick_us;
        heat_ += (size * size - square(continuous)) * least(ticks, kLongestTicks);
        heat_ = heat_ < 0 ? 0 : least(heat_, kHottest);
        hot_ticks_ = heat_ > 0 ? hot_ticks_ + ticks : 0;
    }

    // Before the first arming behind a start: what is left of the most that these limits allow.
    void settle(std::int64_t continuous, std::int32_t most) {
        if (unknown_ticks_ < 0 || most == INT32_MAX) return;
        const std::int64_t left = std::int64_t{most} * ticks_a_second_ -
                                  square(continuous) * unknown_ticks_;
        if (left > heat_) heat_ = left;
        unknown_ticks_ = -1;
    }

    // Whether half of what is allowed is used up: too hot to be armed.
    bool too_hot(std::int32_t most) const {
        return most != INT32_MAX && 2 * heat_ > std::int64_t{most} * ticks_a_second_;
    }

    Crossing check(std::int32_t most, std::int64_t tick_us, std::uint8_t channel) const {
        if (most == INT32_MAX || heat_ <= std::int64_t{most} * ticks_a_second_) return {};
        return {kOverheated, channel, heat_ / ticks_a_second_, most, hot_ticks_ * tick_us};
    }

  private:
    // what no product or sum below can overflow with
    static constexpr std::int64_t kLargest = 1 << 20;
    static constexpr std::int64_t kLongestTicks = 1 << 20;
    static constexpr std::int64_t kHottest = std::int64_t{1} << 61;

    static constexpr std::int64_t least(std::int64_t one, std::int64_t other) {
        return one < other ? one : other;
    }
    static constexpr std::int64_t square(std::int64_t size) {
        return least(size, kLargest) * least(size, kLargest);
    }

    std::int64_t heat_ = 0;  // counts^2 ticks
    std::int64_t hot_ticks_ = 0;
    std::int64_t ticks_a_second_ = 1000;
    std::int64_t unknown_ticks_ = -1;  // since a start whose heat is not known; -1 where it is
};

class MotorGuard {
  public:
    void prime(std::int32_t motor) { last_motor_ = stall_anchor_ = motor; }

    // So many ticks passed since the last one: what the motor went is judged by that time.
    void late(std::int32_t motor, std::int64_t ticks) {
        last_motor_ = motor - (motor - last_motor_) / ticks;
    }
    void begin_to_hold() { stall_ticks_ = 0; }

    // One tick of `tick_us`; `motor_channel` names what crossed.
    Crossing check(const MotorFields& limits, std::int32_t most_stall_ticks, std::int64_t tick_us,
                   std::int32_t motor, std::int32_t current_count, std::uint8_t motor_channel) {
        const std::int64_t step = std::int64_t{motor} - last_motor_;
        last_motor_ = motor;
        fast_ticks_ = magnitude(step) > limits.max_motor_step ? fast_ticks_ + 1 : 0;
        if (fast_ticks_ >= kOverSpeedTicks) {
            return {kOverSpeed, motor_channel, step, limits.max_motor_step,
                    (fast_ticks_ - 1) * tick_us};
        }
        const bool still = magnitude(std::int64_t{motor} - stall_anchor_) <= limits.stall_motion;
        const std::int64_t current = current_count;
        if (still && magnitude(current) >= limits.stall_current) {
            ++stall_ticks_;
        } else {
            stall_anchor_ = motor;
            stall_ticks_ = 0;
        }
        if (stall_ticks_ >= most_stall_ticks) {
            return {kStalled, motor_channel, current, limits.stall_current, stall_ticks_ * tick_us};
        }
        return {};
    }

  private:
    std::int64_t last_motor_ = 0;
    std::int64_t fast_ticks_ = 0;
    std::int64_t stall_anchor_ = 0;
    std::int64_t stall_ticks_ = 0;
};

}  // namespace rig
