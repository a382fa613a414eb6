// An HX711 on two pins, channel A with gain 128: `Pins` has clock(level), data() and wait_ns(time).
// Source: Avia Semiconductor, HX711 data sheet, p. 4 and 5.
#pragma once

#include "load_cell.hpp"

namespace rig {

template <class Pins>
class Hx711 {
  public:
    static constexpr std::uint32_t kLongestTicks = 40;  // at 1 kHz; three conversions of 80 a second

    Pins pins;

    void begin() { pins.clock(false); }

    // Once a tick. A conversion is ready while the data line is low; a clock that stays high for 60 us would switch
    // the converter off, so nothing but short interrupts may come between.
    std::int32_t read() {
        if (!pins.data()) take();
        return newest_.count();
    }

  private:
    void take() {
        std::uint32_t bits = 0;
        for (int k = 0; k < 24; ++k) bits = bits << 1 | pulse();
        pulse();  // the 25th: channel A with gain 128 next time
        newest_.take(bits);
    }
    std::uint32_t pulse() {
        pins.clock(true);
        pins.wait_ns(300);  // data is valid 0.1 us behind the edge; at least 0.2 us high and low
        const std::uint32_t bit = pins.data() ? 1 : 0;
        pins.clock(false);
        pins.wait_ns(300);
        return bit;
    }

    NewestConversion<kLongestTicks> newest_;
};

}  // namespace rig
