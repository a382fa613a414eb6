// The watch of converted sensors over time: at the end of their range, and not changing at all.
#pragma once

#include <cstddef>
#include <cstdint>

#include "crossing.hpp"
#include "limits.hpp"

namespace rig {

// The counts of some sensors next to one another, beginning with channel `first`.
template <std::size_t Sensors>
class SensorGuard {
  public:
    // A count at or beyond `low` or `high` is saturated; `idle` is that of a sound sensor with nothing to measure,
    // which may stay.
    constexpr SensorGuard(std::uint8_t first, std::int32_t low, std::int32_t high,
                          std::int32_t idle = kMissing)
        : first_(first), low_(low), high_(high), idle_(idle) {}

    void prime(const std::int32_t (&counts)[Sensors]) {
        for (std::size_t k = 0; k < Sensors; ++k) last_[k] = counts[k];
    }

    void begin_to_hold() {
        saturated_ticks_ = 0;
        for (std::int64_t& ticks : same_ticks_) ticks = 0;
    }

    Crossing check(const ChoiceFields& choice, std::int64_t tick_us,
                   const std::int32_t (&counts)[Sensors]) {
        std::size_t saturated = Sensors;
        for (std::size_t k = Sensors; k-- > 0;) {
            if (counts[k] <= low_ || counts[k] >= high_) saturated = k;
        }
        saturated_ticks_ = saturated != Sensors ? saturated_ticks_ + 1 : 0;
        if (saturated_ticks_ >= choice.saturated_ticks) {
            return {kSensorSaturated, channel(saturated), counts[saturated], choice.saturated_ticks,
                    saturated_ticks_ * tick_us};
        }
        for (std::size_t k = 0; k < Sensors; ++k) {
            same_ticks_[k] = counts[k] == last_[k] && counts[k] != idle_ ? same_ticks_[k] + 1 : 0;
            last_[k] = counts[k];
            if (same_ticks_[k] >= choice.stale_ticks) {
                return {kSensorStale, channel(k), counts[k], choice.stale_ticks,
                        same_ticks_[k] * tick_us};
            }
        }
        return {};
    }

    bool saturated(const std::int32_t (&counts)[Sensors]) const {
        for (std::int32_t count : counts) {
            if (count <= low_ || count >= high_) return true;
        }
        return false;
    }

  private:
    std::uint8_t channel(std::size_t k) const { return static_cast<std::uint8_t>(first_ + k); }

    std::uint8_t first_;
    std::int32_t low_;
    std::int32_t high_;
    std::int32_t idle_;
    std::int64_t saturated_ticks_ = 0;
    std::int32_t last_[Sensors] = {};
    std::int64_t same_ticks_[Sensors] = {};
};

}  // namespace rig
