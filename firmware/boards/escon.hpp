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

// The read-back of an INA240 (Texas Instruments, SBOS662C) in place of the module's own: gain 20, 50, 100 or 200.
constexpr EsconLine ina240(double shunt_ohm, double gain, double reference_v, double adc_full_v) {
    const double v_per_a = shunt_ohm * gain;
    return {0.0, -reference_v / v_per_a, adc_full_v, (adc_full_v - reference_v) / v_per_a};
}

struct EsconWiring {
    EsconLine set_value;  // of the size of a current; its sign is a line of its own
    double set_full;  // V of the DAC's full scale; 1 for a duty
    EsconLine read_back;
    double adc_full_v;
    double limit_a;
    int output_bits = 12;
    int adc_bits = 12;
    double lowest_v = 0.0;  // what gives the read-back measures between these; an INA240 to 0.2 V below its supply
    double highest_v = 1e9;

    // Never beyond the limit, whatever was commanded.
    std::int32_t code(double current_a) const {
        const double size = std::fabs(current_a);
        const double asked = std::isfinite(current_a) ? (size < limit_a ? size : limit_a) : 0.0;
        const double top = static_cast<double>((1 << output_bits) - 1);
        return static_cast<std::int32_t>(std::floor(set_value.input(asked) / set_full * top + 0.5));
    }

    // Actual current in counts of 1 mA, as the logger's frames carry it. A converter or an amplifier at its end has
    // not measured: that is the end of the field, which the guards find.
    std::int32_t milliampere(std::int32_t reading) const {
        const std::int32_t last = (1 << adc_bits) - 1;
        const double volt = reading * adc_full_v / static_cast<double>(last);
        if (reading <= 0 || volt < lowest_v) return INT16_MIN;
        if (reading >= last || volt > highest_v) return INT16_MAX;
        return static_cast<std::int32_t>(std::floor(1000 * read_back.current(volt) + 0.5));
    }
};

}  // namespace rig
