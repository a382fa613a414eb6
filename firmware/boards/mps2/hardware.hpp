// An emulated Cortex-M4 (QEMU's mps2-an386) as `rig::App` wants its hardware, with a small plant in
// place of the rig. It tries the core as an Arm processor runs it; it tells nothing of timing.
// Registers: Arm, Cortex-M System Design Kit reference manual, APB UART and dual timer.
#pragma once

#include "../../core/app.hpp"
#include "../../host/plain_plant.hpp"

namespace rig {

inline volatile std::uint32_t& at(std::uint32_t address) {
    return *reinterpret_cast<volatile std::uint32_t*>(address);
}

// Bytes as the receive interrupt hands them over: one writer, one reader.
class Received {
  public:
    void put(std::uint8_t byte) {
        if (last_ - first_ < kRoom) bytes_[last_ % kRoom] = byte;
        if (last_ - first_ < kRoom) last_ = last_ + 1;
    }
    std::size_t take(std::uint8_t* out, std::size_t room) {
        std::size_t count = 0;
        for (; count < room && first_ != last_; first_ = first_ + 1) out[count++] = bytes_[first_ % kRoom];
        return count;
    }

  private:
    static constexpr std::uint32_t kRoom = 4096;
    std::uint8_t bytes_[kRoom] = {};
    volatile std::uint32_t first_ = 0;
    volatile std::uint32_t last_ = 0;
};

inline Received received;

class Mps2Hardware {
  public:
    struct Lock {  // tick and exchange take turns; only the bytes received come by interrupt
        Lock() {}
    };

    void begin() {
        at(kTimer + 0x00) = 0xFFFFFFFF;
        at(kTimer + 0x08) = 0x82;  // enabled, 32 bits, free-running
        at(kUart + 0x10) = 16;     // the emulator sends at once, whatever the rate
        at(kUart + 0x08) = 0x0B;   // transmitter, receiver and its interrupt
        at(0xE000E100) = 1;        // interrupt 0: UART 0 has received
        at(0xE000E014) = kTicksAUs * 1000 - 1;
        at(0xE000E018) = 0;
        at(0xE000E010) = 7;  // SysTick only wakes; the timer tells the time
    }

    // Microseconds of the free-running timer; it is looked at far more often than it wraps (171 s).
    std::uint32_t now_us() {
        const std::uint32_t value = at(kTimer + 0x04);
        rest_ += last_value_ - value;  // it counts down
        last_value_ = value;
        us_ += rest_ / kTicksAUs;
        rest_ %= kTicksAUs;
        return us_;
    }

    ReferenceProfile::Inputs sample() { return plant_.sample(); }
    void drive(const ReferenceProfile::Outputs& outputs) { plant_.step(outputs); }
    std::size_t read(std::uint8_t* out, std::size_t room) { return received.take(out, room); }

    std::size_t write(const std::uint8_t* data, std::size_t size) {
        std::size_t count = 0;
        while (count < size && (at(kUart + 0x04) & 1U) == 0) at(kUart) = data[count++];
        return count;
    }

    static void on_received() {
        at(kUart + 0x0C) = 2;  // first: a byte that comes while these are taken interrupts again
        while ((at(kUart + 0x04) & 2U) != 0) received.put(static_cast<std::uint8_t>(at(kUart)));
    }

  private:
    static constexpr std::uint32_t kUart = 0x40004000;
    static constexpr std::uint32_t kTimer = 0x40002000;
    static constexpr std::uint32_t kTicksAUs = 25;

    PlainPlant plant_;
    std::uint32_t last_value_ = 0xFFFFFFFF;
    std::uint32_t rest_ = 0;
    std::uint32_t us_ = 0;
};

}  // namespace rig
