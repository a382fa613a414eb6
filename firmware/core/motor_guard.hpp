// The watch of one motor over time: over-speed, heat, stall. The twin of `motor_crossing` in
// drivers/teensy/guard.py, the same whole-number operations in the same order. Counts and ticks.
#pragma once

#include <cstdint>
#include <initializer_list>

#include "crossing.hpp"

namespace rig {

constexpr std::int64_t kOverSpeedTicks = 3;

// In the order of the wire.
struct MotorLimits {
    std::int32_t max_step = 0;            // counts a tick
    std::int32_t continuous_current = 0;  // counts
    std::int32_t i2t = 0;                 // counts^2 s above the continuous current
    std::int32_t stall_current = 0;
    std::int32_t stall_motion = 0;  // motor counts

    void read(Reader& reader) {
        for (std::int32_t* limit :
             {&max_step, &continuous_current, &i2t, &stall_current, &stall_motion}) {
            *limit = reader.i32();
        }
    }

    bool valid() const {
        for (std::int32_t size : {max_step, continuous_current, i2t, stall_current, stall_motion}) {
            if (size < 0) return false;
        }
        return true;
    }
};

class MotorGuard {
  public:
    void prime(std::int32_t motor) { last_motor_ = stall_anchor_ = motor; }
    void begin_to_hold() { stall_ticks_ = 0; }

    // One tick of `tick_us`; `motor_channel` and `current_channel` name what crossed.
    Crossing check(const MotorLimits& limits, std::int32_t most_stall_ticks, std::int64_t tick_us,
                   std::int32_t motor, std::int32_t current_count, std::uint8_t motor_channel,
                   std::uint8_t current_channel) {
        const std::int64_t step = std::int64_t{motor} - last_motor_;
        last_motor_ = motor;
        fast_ticks_ = magnitude(step) > limits.max_step ? fast_ticks_ + 1 : 0;
        if (fast_ticks_ >= kOverSpeedTicks) {
            return {kOverSpeed, motor_channel, step, limits.max_step, (fast_ticks_ - 1) * tick_us};
        }
        const std::int64_t current = current_count;
        const std::int64_t continuous = limits.continuous_current;
        const std::int64_t ticks_a_second = 1000000 / tick_us;
        heat_ += current * current - continuous * continuous;
        if (heat_ < 0) heat_ = 0;
        hot_ticks_ = heat_ > 0 ? hot_ticks_ + 1 : 0;
        if (heat_ > std::int64_t{limits.i2t} * ticks_a_second) {
            return {kOverheated, current_channel, heat_ / ticks_a_second, limits.i2t,
                    hot_ticks_ * tick_us};
        }
        const bool still = magnitude(std::int64_t{motor} - stall_anchor_) <= limits.stall_motion;
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
    std::int64_t heat_ = 0;
    std::int64_t hot_ticks_ = 0;
    std::int64_t stall_anchor_ = 0;
    std::int64_t stall_ticks_ = 0;
};

}  // namespace rig
