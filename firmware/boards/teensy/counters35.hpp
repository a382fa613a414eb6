// The three encoders of a Teensy 3.5: it has two hardware decoders of 16 bits, FTM1 and FTM2, for the
// motor and the jaw. The spindle, the slowest, is decoded by interrupts at its edges; they come before
// the sampling, or two edges during a slow sample would be one.
// Registers: NXP, K64 Sub-Family Reference Manual, chapters FTM and signal multiplexing.
#pragma once

#include <Arduino.h>

#include "../quadrature.hpp"
#include "wiring35.hpp"

namespace rig {

class Counters {
  public:
    void begin() {
        PORTA_PCR12 = PORT_PCR_MUX(7);  // pins 3 and 4: FTM1's phases
        PORTA_PCR13 = PORT_PCR_MUX(7);
        PORTB_PCR18 = PORT_PCR_MUX(6);  // pins 29 and 30: FTM2's phases
        PORTB_PCR19 = PORT_PCR_MUX(6);
        decode(FTM1_MODE, FTM1_SC, FTM1_CNTIN, FTM1_MOD, FTM1_CNT, FTM1_FILTER,
               FTM1_QDCTRL);
        decode(FTM2_MODE, FTM2_SC, FTM2_CNTIN, FTM2_MOD, FTM2_CNT, FTM2_FILTER,
               FTM2_QDCTRL);
        motor_.start(0);
        jaw_.start(0);

        pinMode(wiring::kSpindleA, INPUT_PULLUP);
        pinMode(wiring::kSpindleB, INPUT_PULLUP);
        spindle_.start(high(wiring::kSpindleA), high(wiring::kSpindleB));
        attachInterrupt(digitalPinToInterrupt(wiring::kSpindleA), on_edge, CHANGE);
        attachInterrupt(digitalPinToInterrupt(wiring::kSpindleB), on_edge, CHANGE);
        NVIC_SET_PRIORITY(IRQ_PORTC, wiring::kEdgePriority);
    }

    std::int32_t motor() { return motor_.follow(static_cast<std::uint16_t>(FTM1_CNT)); }
    std::int32_t jaw() { return jaw_.follow(static_cast<std::uint16_t>(FTM2_CNT)); }
    std::int32_t spindle() { return spindle_.count(); }

  private:
    using Register = volatile std::uint32_t;

    // The core has left the timer as PWM: its clock off first, then its limits, then the decoder.
    static void decode(Register& mode, Register& status, Register& first, Register& last,
                       Register& count, Register& filter, Register& quadrature) {
        mode = FTM_MODE_WPDIS | FTM_MODE_FTMEN;
        status = 0;
        first = 0;
        last = 0xFFFF;
        count = 0;
        // a level counts after it was the same for 5 x 4 cycles of the 60 MHz bus, 0.33 us
        filter = 5 | 5 << 4;
        quadrature = FTM_QDCTRL_QUADEN | FTM_QDCTRL_PHAFLTREN | FTM_QDCTRL_PHBFLTREN;
    }

    static bool high(int pin) { return digitalReadFast(pin) != LOW; }
    static void on_edge() { spindle_.edge(high(wiring::kSpindleA), high(wiring::kSpindleB)); }

    WideCounter motor_;
    WideCounter jaw_;
    static inline EdgeDecoder spindle_;
};

}  // namespace rig
