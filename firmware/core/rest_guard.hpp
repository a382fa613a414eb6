// Whether a drive train whose encoders do not count can be at rest. At rest every torque that changes turns some
// encoder, for the gearhead is elastic; and behind a motion the current cannot rise by much more than the friction
// it just overcame. Torques in counts of the torque sensor. What is found at rest in the grasp of an object passes:
// there the torque that the current makes is found at the sensor, and its rise has turned the motor.
#pragma once

#include <cstdint>

#include "crossing.hpp"

namespace rig {

struct RestLimits {
    std::int32_t torque_e3 = 0;       // counts of torque for 1000 of current, signed; 0 for none
    std::int32_t forward = 0;         // sign of the torque that turns the motor's count up
    std::int32_t max_unfound = 0;     // made by the current, not found by the sensor, and not in doubt
    std::int32_t max_change = 0;      // of the sensor, while no encoder counts
    std::int32_t max_rise = 0;        // of what is not found, the way the motor turned last
};

class RestGuard {
  public:
    std::int64_t still_ticks() const { return still_ticks_; }  // since an encoder counted

    Crossing check(const RestLimits& limits, std::int64_t tick_us, const std::int32_t (&counts)[3],
                   std::int32_t torque, std::int32_t current) {
        const std::int64_t made = kFine * within_largest(current) * limits.torque_e3 / 1000;
        follow(counts, kFine * torque, made);
        if (limits.torque_e3 == 0) return {};
        const std::int64_t late_us = still_ticks_ * tick_us;
        const std::int64_t change = (torque_ - torque_before_) / kFine;
        if (exceeds(change, limits.max_change)) {
            return {kEncoderFrozen, 0, change, limits.max_change, late_us};
        }
        if (still_ticks_ < kRestTicks) return {};
        const std::int64_t unfound = (made_ - torque_) / kFine;
        const std::int64_t doubt = magnitude(made_) / kFine / kDoubt;
        if (limits.max_unfound != INT32_MAX && magnitude(unfound) > limits.max_unfound + doubt) {
            return {kEncoderFrozen, 0, unfound, limits.max_unfound, late_us};
        }
        const std::int64_t rise = (slow_unfound_ - unfound_before_) / kFine * way_ * limits.forward;
        if (still_ticks_ >= kSlowTicks && limits.max_rise != INT32_MAX && rise > limits.max_rise) {
            return {kEncoderFrozen, 0, rise, limits.max_rise, late_us};
        }
        return {};
    }

  private:
    static constexpr std::int64_t kFine = 256;      // parts of a count, for means of whole numbers
    static constexpr std::int64_t kMeanTicks = 5;   // against noise
    static constexpr std::int64_t kSlowMeanTicks = 20;
    static constexpr std::int64_t kRestTicks = 20;  // behind which a motor that was turning is at rest
    static constexpr std::int64_t kSlowTicks = 50;

    static constexpr std::int64_t kLargest = 1 << 20;  // what no product above can overflow with

    static std::int64_t within_largest(std::int32_t current) {
        return current > kLargest ? kLargest : current < -kLargest ? -kLargest : current;
    }

    // Keeps the means, and where the encoders stood last.
    void follow(const std::int32_t (&counts)[3], std::int64_t torque, std::int64_t made) {
        if (!primed_) {
            torque_ = torque;
            made_ = made;
            slow_unfound_ = made - torque;
        }
        torque_ += (torque - torque_) / kMeanTicks;
        made_ += (made - made_) / kMeanTicks;
        slow_unfound_ += (made - torque - slow_unfound_) / kSlowMeanTicks;
        bool moved = !primed_;
        for (int k = 0; k < 3; ++k) moved = moved || magnitude(std::int64_t{counts[k]} - still_at_[k]) > 1;
        const std::int64_t turned = primed_ ? std::int64_t{counts[0]} - still_at_[0] : 0;
        primed_ = true;
        ++still_ticks_;
        if (!moved) return;
        if (turned > 1) way_ = 1;
        if (turned < -1) way_ = -1;
        for (int k = 0; k < 3; ++k) still_at_[k] = counts[k];
        torque_before_ = torque_;
        unfound_before_ = slow_unfound_;
        still_ticks_ = 0;
    }

    std::int32_t still_at_[3] = {};
    std::int64_t still_ticks_ = 0;
    std::int64_t torque_ = 0;  // in parts of a count, as all of these
    std::int64_t made_ = 0;
    std::int64_t slow_unfound_ = 0;
    std::int64_t torque_before_ = 0;
    std::int64_t unfound_before_ = 0;
    std::int64_t way_ = 0;  // of the motor's count in its last motion
    bool primed_ = false;
};

}  // namespace rig
