// What a guard says of a tick: which limit was crossed, by what, and how late it was noticed.
#pragma once

#include <cstdint>

#include "protocol.hpp"

namespace rig {

constexpr std::int32_t kMissing = INT32_MIN;  // count of a sensor that gave nothing
constexpr std::uint8_t kNoChannel = 255;
constexpr std::int64_t kDoubt = 2;  // declared stiffness and torque constant may be wrong by one part in so many

struct Crossing {
    Trip code = kNoTrip;
    std::uint8_t channel = kNoChannel;
    std::int64_t value = 0;
    std::int64_t limit = 0;
    std::int64_t late_us = 0;  // since it began
};

constexpr std::int64_t magnitude(std::int64_t value) { return value < 0 ? -value : value; }

// INT32_MAX is no limit: a difference of two counts can be larger.
constexpr bool exceeds(std::int64_t value, std::int32_t limit) {
    return limit != INT32_MAX && magnitude(value) > limit;
}

}  // namespace rig
