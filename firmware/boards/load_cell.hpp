// What a converter of a load cell gives the logger, whichever it is: the newest conversion in the 16 bits of a
// sample. At an end of the converter that is the end of the field, which the guards find; without a conversion for
// some time the reading is missing, which trips.
#pragma once

#include <cstdint>

#include "../core/crossing.hpp"

namespace rig {

template <std::uint32_t LongestTicks>
class NewestConversion {
  public:
    // Of a 24-bit two's complement.
    void take(std::uint32_t bits) {
        count_ = static_cast<std::int32_t>(bits << 8) >> 16;
        age_ticks_ = 0;
    }
    // Once a tick.
    std::int32_t count() {
        if (age_ticks_ > LongestTicks) return kMissing;
        ++age_ticks_;
        return count_;
    }

  private:
    std::uint32_t age_ticks_ = UINT32_MAX;  // none yet
    std::int32_t count_ = 0;
};

}  // namespace rig
