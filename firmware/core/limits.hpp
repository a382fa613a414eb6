// The limits held against every sample while armed, the twin of drivers/teensy/limits.py. Counts.
#pragma once

#include <cstdint>

namespace rig {

// What is sampled at the beginning of a tick, in counts.
struct Inputs {
    std::int32_t motor = 0;
    std::int32_t spindle = 0;
    std::int32_t jaw = 0;
    std::int32_t proximal = 0;
    std::int32_t distal = 0;
    std::int32_t current = 0;
    std::int32_t fsr = 0;
};

struct Limits {
    std::int32_t max_current = 0;
    std::int32_t max_load_ma = 0;
    std::int32_t max_proximal = 0;
    std::int32_t max_distal = 0;
    std::int32_t min_spindle = 0;
    std::int32_t max_spindle = 0;

    bool valid() const {
        return max_current >= 0 && max_load_ma >= 0 && max_proximal >= 0 && max_distal >= 0 &&
               min_spindle <= max_spindle;
    }

    bool crossed_by(const Inputs& inputs) const {
        return !within(inputs.current, max_current) || !within(inputs.proximal, max_proximal) ||
               !within(inputs.distal, max_distal) || !spindle_allowed(inputs.spindle);
    }

    bool allow(std::int32_t target, std::int32_t load_ma) const {
        return within(load_ma, max_load_ma) && spindle_allowed(target);
    }

  private:
    static bool within(std::int32_t value, std::int32_t size) {
        return -size <= value && value <= size;
    }
    bool spindle_allowed(std::int32_t count) const {
        return min_spindle <= count && count <= max_spindle;
    }
};

}  // namespace rig
