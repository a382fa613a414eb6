// Whether one motor's position loop can be believed: its encoder does not jump, is not frozen while the
// current changes, follows the target, and the current is the one that was commanded. Counts and ticks.
#pragma once

#include <cstdint>

#include "crossing.hpp"
#include "limits.hpp"

namespace rig {

constexpr std::int64_t kEnableUs = 20000;  // a motor controller acts within 8 ms of its enable

// Numbers of the channels a crossing names.
struct LoopChannels {
    std::uint8_t followed;
    std::uint8_t motor;
    std::uint8_t current;
};

class LoopGuard {
  public:
    void prime(std::int32_t motor, std::int32_t current) {
        last_motor_ = anchor_ = motor;
        still_mean_ = anchor_current_ = kFine * current;
    }

    // See MotorGuard::late.
    void late(std::int32_t motor, std::int64_t ticks) {
        last_motor_ = motor - (motor - last_motor_) / ticks;
    }

    // What the tick asked for; the next one is held against it.
    void drove(std::int32_t target, std::int32_t command_e4) {
        target_ = target;
        command_e4_ = command_e4;
        ++driven_ticks_;
    }

    void begin_to_hold() { far_ticks_ = 0; }

    Crossing check(const LoopFields& limits, std::int64_t tick_us, std::int32_t followed,
                   std::int32_t motor, std::int32_t current, const LoopChannels& channels) {
        const std::int64_t step = std::int64_t{motor} - last_motor_;
        last_motor_ = motor;
        if (exceeds(step, limits.max_motor_jump)) {
            return {kEncoderJump, channels.motor, step, limits.max_motor_jump, 0};
        }
        const Crossing frozen = check_frozen(limits, tick_us, motor, current, channels.motor);
        if (frozen.code != kNoTrip || driven_ticks_ == 0) return frozen;
        const std::int64_t behind = std::int64_t{target_} - followed;
        far_ticks_ = exceeds(behind, limits.max_following) ? far_ticks_ + 1 : 0;
        if (far_ticks_ >= limits.following_ticks) {
            return {kFollowingError, channels.followed, behind, limits.max_following,
                    far_ticks_ * tick_us};
        }
        return check_current(limits, tick_us, current, channels.current);
    }

  private:
    static constexpr std::int64_t kFine = 256;       // parts of a count, for means of whole numbers
    static constexpr std::int64_t kStillTicks = 5;  // mean of the current, against its noise

    // A motor whose count stays while the current goes from one value to quite another.
    Crossing check_frozen(const LoopFields& limits, std::int64_t tick_us, std::int32_t motor,
                          std::int32_t current, std::uint8_t channel) {
        still_mean_ += (kFine * current - still_mean_) / kStillTicks;
        if (magnitude(std::int64_t{motor} - anchor_) > limits.frozen_motion) {
            anchor_ = motor;
            anchor_current_ = still_mean_;
            still_ticks_ = 0;
        }
        ++still_ticks_;
        const std::int64_t change = (still_mean_ - anchor_current_) / kFine;
        if (exceeds(change, limits.frozen_current)) {
            return {kEncoderFrozen, channel, change, limits.frozen_current, still_ticks_ * tick_us};
        }
        return {};
    }

    Crossing check_current(const LoopFields& limits, std::int64_t tick_us, std::int32_t current,
                           std::uint8_t channel) {
        if (limits.full_scale_current == 0 || driven_ticks_ * tick_us <= kEnableUs) return {};
        const std::int64_t commanded =
            limits.current_offset + std::int64_t{limits.full_scale_current} * command_e4_ / 10000;
        error_mean_ += (kFine * (current - commanded) - error_mean_) / limits.current_ticks;
        const std::int64_t error = error_mean_ / kFine;
        if (exceeds(error, limits.max_current_error)) {
            return {kCurrentMismatch, channel, error, limits.max_current_error,
                    limits.current_ticks * tick_us};
        }
        return {};
    }

    std::int64_t last_motor_ = 0;
    std::int64_t anchor_ = 0;
    std::int64_t anchor_current_ = 0;  // in parts of a count, as both means
    std::int64_t still_mean_ = 0;
    std::int64_t still_ticks_ = 0;
    std::int64_t error_mean_ = 0;
    std::int64_t far_ticks_ = 0;
    std::int64_t driven_ticks_ = 0;
    std::int32_t target_ = 0;
    std::int32_t command_e4_ = 0;
};

}  // namespace rig
