// Which pins of a Teensy 4.1 reach a hardware decoder, and through which input of the crossbar XBARA1.
// Pins 0, 5 and 37 share one input, pins 1 and 36 another: of pins that share, only one is connected.
// Source: NXP, i.MX RT1060 reference manual, XBARA1 and IOMUXC; Teensy-4.x-Quad-Encoder-Library.
#pragma once

#include <cstddef>

namespace rig {

// -1 where a pin reaches none.
constexpr int crossbar_input(int pin) {
    switch (pin) {
        case 0: case 5: case 37: return 17;
        case 1: case 36: return 16;
        case 2: return 6;
        case 3: return 7;
        case 4: return 8;
        case 7: return 15;
        case 8: return 14;
        case 30: return 23;
        case 31: return 22;
        case 33: return 9;
        default: return -1;
    }
}

// Whether every pin reaches a decoder through an input of its own.
template <std::size_t Pins>
constexpr bool inputs_are_exclusive(const int (&pins)[Pins]) {
    for (std::size_t k = 0; k < Pins; ++k) {
        if (crossbar_input(pins[k]) < 0) return false;
        for (std::size_t j = 0; j < k; ++j) {
            if (crossbar_input(pins[k]) == crossbar_input(pins[j])) return false;
        }
    }
    return true;
}

static_assert(!inputs_are_exclusive({0, 1, 2, 3, 5, 7}), "pins 0 and 5 share an input");
static_assert(!inputs_are_exclusive({0, 6}), "pin 6 reaches no decoder");

}  // namespace rig
