// The watchdog of the chip, the line that shows that it is alive, and what a fault does. To be included
// behind a wiring header. A reset leaves every pin an input, so pull-downs take the enables low.
// Registers: NXP, K64 reference manual, WDOG; i.MX RT1060 reference manual, RTWDOG (WDOG3).
#pragma once

#include <Arduino.h>

#include <cstdint>

namespace rig {

// Without a meal for so long the chip is reset.
constexpr std::uint32_t kChipSilentMs = 16;

class ChipWatch {
  public:
    // Cannot be taken back: only a reset ends it.
    void begin() {
        pinMode(wiring::kAlivePin, OUTPUT);
        noInterrupts();  // the registers are open for a few cycles only
#if defined(ARDUINO_TEENSY35)
        WDOG_UNLOCK = WDOG_UNLOCK_SEQ1;
        WDOG_UNLOCK = WDOG_UNLOCK_SEQ2;
        asm volatile("nop\n nop");
        WDOG_TOVALH = 0;
        WDOG_TOVALL = kChipSilentMs;  // of the 1 kHz oscillator, which does not hang on the core's clock
        WDOG_PRESC = 0;
        WDOG_STCTRLH = WDOG_STCTRLH_WDOGEN | WDOG_STCTRLH_WAITEN | WDOG_STCTRLH_STOPEN;
#else
        CCM_CCGR5 |= CCM_CCGR5_WDOG3(CCM_CCGR_ON);
        if ((WDOG3_CS & WDOG_CS_CMD32EN) != 0) {
            WDOG3_CNT = 0xD928C520U;
        } else {
            WDOG3_CNT = 0xC520U;
            WDOG3_CNT = 0xD928U;
        }
        WDOG3_TOVAL = kChipSilentMs * 32768U / 1000U;  // of the 32.768 kHz oscillator
        WDOG3_CS = WDOG_CS_EN | WDOG_CS_CLK(1) | WDOG_CS_CMD32EN | WDOG_CS_WAIT | WDOG_CS_STOP;
#endif
        interrupts();
    }

    // From the tick, see rig::Liveness. The line toggles with every meal.
    void feed() {
        noInterrupts();
#if defined(ARDUINO_TEENSY35)
        WDOG_REFRESH = 0xA602;
        WDOG_REFRESH = 0xB480;
#else
        WDOG3_CNT = 0xB480A602U;
#endif
        interrupts();
        alive_ = !alive_;
        digitalWrite(wiring::kAlivePin, alive_ ? HIGH : LOW);
    }

  private:
    bool alive_ = false;
};

}  // namespace rig

#if defined(__arm__)
// A fault: motors off first, on a stack that is sound, then wait for the watchdog's reset. The core's own
// handlers would go on for seconds, or for ever, with the enables as they were.
extern "C" {

[[noreturn]] void rig_stop_at_fault() {
    rig::motors_off();
    for (;;) {
    }
}

__attribute__((naked)) void rig_fault() {
    asm volatile("ldr r0, =_estack\n mov sp, r0\n b rig_stop_at_fault");
}

#if defined(ARDUINO_TEENSY35)
void nmi_isr() __attribute__((alias("rig_fault"), nothrow));
void hard_fault_isr() __attribute__((alias("rig_fault"), nothrow));
void memmanage_fault_isr() __attribute__((alias("rig_fault"), nothrow));
void bus_fault_isr() __attribute__((alias("rig_fault"), nothrow));
void usage_fault_isr() __attribute__((alias("rig_fault"), nothrow));
#endif
}
#endif

namespace rig {

inline void take_faults() {
#if defined(__arm__) && !defined(ARDUINO_TEENSY35)
    for (int vector = 2; vector <= 6; ++vector) _VectorsRam[vector] = rig_fault;  // NMI to usage fault
#endif
}

}  // namespace rig
