// An ESCON 24/2 at a board: the code for a current, and the current of a reading. No
// Arduino here, so that it runs on any host.
#pragma once

#include <cmath>
#include <cstdint>

namespace rig {

// A line through two points, as ESCON Studio takes it: input in V or duty, current in A.
struct EsconLine {
    double x1;
    double y1;
    double x2;
    double y2;

    double current(double x) const { return y1 + (x - x1) * (y2 - y1) / (x2 - x1); }
    double input(double current_a) const { return x1 + (current_a - y1) * (x2 - x1) / (y2 - y1); }
};

struct EsconWiring {
    EsconLine set_value;  // of the size of a current; its sign is a line of its own
    double set_full;  // V of the DAC's full scale; 1 for a duty
    EsconLine read_back;
    double adc_full_v;
    double limit_a;
    int output_bits = 12;
    int adc_bits = 12;

    // Never beyond the limit, whatever was commanded.
    std::int32_t code(double current_a) const {
        const double size = std::fabs(current_a);
        const double asked = std::isfinite(current_a) ? (size < limit_a ? size : limit_a) : 0.0;
        const double top = static_cast<double>((1 << output_bits) - 1);
        return static_cast<std::int32_t>(std::floor(set_value.input(asked) / set_full * top + 0.5));
    }

    // Actual current in counts of 1 mA, as the logger's frames carry it. A converter at its end has not measured:
    // that is the end of the field, which the guards find.
    std::int32_t milliampere(std::int32_t reading) const {
        const std::int32_t last = (1 << adc_bits) - 1;
        if (reading <= 0) return INT16_MIN;
        if (reading >= last) return INT16_MAX;
        const double top = static_cast<double>(last);
        return static_cast<std::int32_t>(
            std::floor(1000 * read_back.current(reading * adc_full_v / top) + 0.5));
    }
};

}  // namespace rig
