// What an armed board holds against every sample, and what it did about it: the twin of
// drivers/teensy/guard.py, the same whole-number operations in the same order. Counts and ticks.
#pragma once

#include <cstdint>

#include "protocol.hpp"

namespace rig {

// What is sampled at the beginning of a tick, in counts; kMissing where a sensor gave nothing.
struct Inputs {
    std::int32_t motor = 0;
    std::int32_t spindle = 0;
    std::int32_t jaw = 0;
    std::int32_t proximal = 0;
    std::int32_t distal = 0;
    std::int32_t current = 0;
    std::int32_t fsr = 0;
};

constexpr std::int32_t kMissing = INT32_MIN;
constexpr std::int64_t kOverSpeedTicks = 3;
constexpr std::int32_t kHold = 1;
constexpr std::uint8_t kNoChannel = 255;

// In the order of the wire.
struct Limits {
    std::int32_t max_current = 0;
    std::int32_t max_load_ma = 0;
    std::int32_t max_proximal = 0;
    std::int32_t max_distal = 0;
    std::int32_t min_spindle = 0;
    std::int32_t max_spindle = 0;
    std::int32_t min_jaw = 0;
    std::int32_t max_jaw = 0;
    std::int32_t max_motor_step = 0;      // counts a tick
    std::int32_t continuous_current = 0;  // counts
    std::int32_t i2t = 0;                 // counts^2 s above the continuous current
    std::int32_t stall_current = 0;
    std::int32_t stall_motion = 0;  // motor counts
    std::int32_t stall_ticks = 1;
    std::int32_t saturated_ticks = 1;
    std::int32_t stale_ticks = 1;
    std::int32_t watchdog_us = 0;
    std::int32_t safe_state = 0;  // 0 release, 1 hold
    std::int32_t hold_command_e4 = 0;

    static Limits read(Reader& reader) {
        Limits limits;
        for (std::int32_t* limit :
             {&limits.max_current,    &limits.max_load_ma,        &limits.max_proximal,
              &limits.max_distal,     &limits.min_spindle,        &limits.max_spindle,
              &limits.min_jaw,        &limits.max_jaw,            &limits.max_motor_step,
              &limits.continuous_current, &limits.i2t,            &limits.stall_current,
              &limits.stall_motion,   &limits.stall_ticks,        &limits.saturated_ticks,
              &limits.stale_ticks,    &limits.watchdog_us,        &limits.safe_state,
              &limits.hold_command_e4}) {
            *limit = reader.i32();
        }
        return limits;
    }

    bool valid() const {
        for (std::int32_t size : {max_current, max_load_ma, max_proximal, max_distal, max_motor_step,
                                  continuous_current, i2t, stall_current, stall_motion}) {
            if (size < 0) return false;
        }
        for (std::int32_t ticks : {stall_ticks, saturated_ticks, stale_ticks}) {
            if (ticks < 1) return false;
        }
        return min_spindle <= max_spindle && min_jaw <= max_jaw && kMinWatchdogUs <= watchdog_us &&
               watchdog_us <= kMaxWatchdogUs && (safe_state == 0 || safe_state == kHold) &&
               0 <= hold_command_e4 && hold_command_e4 <= 10000;
    }

    bool allow(std::int32_t target, std::int32_t load_ma) const {
        return -max_load_ma <= load_ma && load_ma <= max_load_ma && min_spindle <= target &&
               target <= max_spindle;
    }
};

// The first crossing since the board was armed.
struct Crossing {
    Trip code = kNoTrip;
    std::uint8_t channel = kNoChannel;
    std::int64_t value = 0;
    std::int64_t limit = 0;
    std::int64_t late_us = 0;  // since it began
};

class Guard {
  public:
    void arm(const Limits& limits) {
        *this = Guard();
        limits_ = limits;
    }

    // What made the board hold is not to release it at once.
    void begin_to_hold() {
        stall_ticks_ = 0;
        saturated_ticks_ = 0;
        for (std::int64_t& ticks : same_ticks_) ticks = 0;
    }

    const Limits& limits() const { return limits_; }

    // One tick of an armed or holding board; code kNoTrip when nothing is crossed.
    Crossing check(const Inputs& now) {
        const std::int32_t channels[6] = {now.motor,    now.spindle, now.jaw,
                                          now.proximal, now.distal,  now.current};
        for (std::uint8_t k = 0; k < 6; ++k) {
            if (channels[k] == kMissing) return {kSensorMissing, k, kMissing, 0, 0};
        }
        if (!primed_) prime(now);
        const Crossing crossing = check_levels(now);
        if (crossing.code != kNoTrip) return crossing;
        const Crossing motion = check_motion(now);
        return motion.code != kNoTrip ? motion : check_sensors(channels);
    }

  private:
    void prime(const Inputs& now) {
        primed_ = true;
        last_motor_ = stall_anchor_ = now.motor;
        last_[0] = now.proximal;
        last_[1] = now.distal;
        last_[2] = now.current;
    }

    Crossing check_levels(const Inputs& now) const {
        if (size(now.current) > limits_.max_current) {
            return {kOverCurrent, 5, now.current, limits_.max_current, 0};
        }
        if (size(now.proximal) > limits_.max_proximal) {
            return {kProximalTorque, 3, now.proximal, limits_.max_proximal, 0};
        }
        if (size(now.distal) > limits_.max_distal) {
            return {kDistalTorque, 4, now.distal, limits_.max_distal, 0};
        }
        if (now.spindle < limits_.min_spindle) {
            return {kSpindleTravel, 1, now.spindle, limits_.min_spindle, 0};
        }
        if (now.spindle > limits_.max_spindle) {
            return {kSpindleTravel, 1, now.spindle, limits_.max_spindle, 0};
        }
        if (now.jaw < limits_.min_jaw) return {kJawTravel, 2, now.jaw, limits_.min_jaw, 0};
        if (now.jaw > limits_.max_jaw) return {kJawTravel, 2, now.jaw, limits_.max_jaw, 0};
        return {};
    }

    Crossing check_motion(const Inputs& now) {
        const std::int64_t step = std::int64_t{now.motor} - last_motor_;
        last_motor_ = now.motor;
        fast_ticks_ = size(step) > limits_.max_motor_step ? fast_ticks_ + 1 : 0;
        if (fast_ticks_ >= kOverSpeedTicks) {
            return {kOverSpeed, 0, step, limits_.max_motor_step, (fast_ticks_ - 1) * kTickUs};
        }
        const std::int64_t current = now.current;
        const std::int64_t continuous = limits_.continuous_current;
        heat_ += current * current - continuous * continuous;
        if (heat_ < 0) heat_ = 0;
        hot_ticks_ = heat_ > 0 ? hot_ticks_ + 1 : 0;
        if (heat_ > std::int64_t{limits_.i2t} * 1000) {
            return {kOverheated, 5, heat_ / 1000, limits_.i2t, hot_ticks_ * kTickUs};
        }
        const bool still = size(std::int64_t{now.motor} - stall_anchor_) <= limits_.stall_motion;
        if (still && size(current) >= limits_.stall_current) {
            ++stall_ticks_;
        } else {
            stall_anchor_ = now.motor;
            stall_ticks_ = 0;
        }
        if (stall_ticks_ >= limits_.stall_ticks) {
            return {kStalled, 0, current, limits_.stall_current, stall_ticks_ * kTickUs};
        }
        return {};
    }

    Crossing check_sensors(const std::int32_t (&channels)[6]) {
        std::uint8_t saturated = kNoChannel;
        for (std::uint8_t k = 5; k >= 3; --k) {
            if (channels[k] <= INT16_MIN || channels[k] >= INT16_MAX) saturated = k;
        }
        saturated_ticks_ = saturated != kNoChannel ? saturated_ticks_ + 1 : 0;
        if (saturated_ticks_ >= limits_.saturated_ticks) {
            return {kSensorSaturated, saturated, channels[saturated], limits_.saturated_ticks,
                    saturated_ticks_ * kTickUs};
        }
        for (std::uint8_t k = 0; k < 3; ++k) {
            const std::int32_t count = channels[3 + k];
            same_ticks_[k] = count == last_[k] ? same_ticks_[k] + 1 : 0;
            last_[k] = count;
            if (same_ticks_[k] >= limits_.stale_ticks) {
                return {kSensorStale, static_cast<std::uint8_t>(3 + k), count, limits_.stale_ticks,
                        same_ticks_[k] * kTickUs};
            }
        }
        return {};
    }

    static std::int64_t size(std::int64_t value) { return value < 0 ? -value : value; }

    Limits limits_;
    bool primed_ = false;
    std::int64_t last_motor_ = 0;
    std::int64_t fast_ticks_ = 0;
    std::int64_t heat_ = 0;
    std::int64_t hot_ticks_ = 0;
    std::int64_t stall_anchor_ = 0;
    std::int64_t stall_ticks_ = 0;
    std::int64_t saturated_ticks_ = 0;
    std::int32_t last_[3] = {};
    std::int64_t same_ticks_[3] = {};
};

}  // namespace rig
