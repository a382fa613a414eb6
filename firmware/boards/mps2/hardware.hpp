// An emulated Cortex-M4 (QEMU's mps2-an386) as `rig::App` wants its hardware, with a small plant in
// place of the rig. It tries the core as an Arm processor runs it; it shows nothing about timing: its
// time passes only as the host asks for ticks, so a loaded computer changes nothing.
//
// On the serial line, whole numbers little-endian:
//   host:  ticks u16, size u16, so many bytes for the board
//   board: size u16 and so many bytes from the board, repeated; size 0 ends the turn
// Registers: Arm, Cortex-M System Design Kit reference manual, APB UART.
#pragma once

#include "../../core/app.hpp"
#include "../../host/plain_plant.hpp"

namespace rig {

inline volatile std::uint32_t& at(std::uint32_t address) {
    return *reinterpret_cast<volatile std::uint32_t*>(address);
}

class Mps2Hardware {
  public:
    struct Lock {  // nothing interrupts
        Lock() {}
    };

    void begin() {
        at(kUart + 0x10) = 16;  // the emulator sends at once, whatever the rate
        at(kUart + 0x08) = 3;   // transmitter and receiver
    }

    // Waits for the host's turn; its bytes are then there to `read`. Returns the ticks it asks for.
    std::uint32_t take_turn() {
        const std::uint32_t ticks = get_number();
        unread_ = get_number();
        return ticks;
    }
    bool has_unread() const { return unread_ != 0; }
    void end_turn() { put_number(0); }

    ReferenceProfile::Inputs sample() { return plant_.sample(); }
    void drive(const ReferenceProfile::Outputs& outputs) { plant_.step(outputs); }

    bool stopped() { return false; }  // no emergency stop is wired to it
    void feed() {}  // no watchdog: it runs in the host's time

    std::size_t read(std::uint8_t* out, std::size_t room) {
        std::size_t count = 0;
        for (; count < room && unread_ != 0; --unread_) out[count++] = get();
        return count;
    }

    std::size_t write(const std::uint8_t* data, std::size_t size) {
        put_number(size);
        for (std::size_t k = 0; k < size; ++k) put(data[k]);
        return size;
    }

  private:
    static constexpr std::uint32_t kUart = 0x40004000;

    static std::uint8_t get() {
        while ((at(kUart + 0x04) & 2U) == 0) {
        }
        return static_cast<std::uint8_t>(at(kUart));
    }
    static void put(std::uint8_t byte) {
        while ((at(kUart + 0x04) & 1U) != 0) {
        }
        at(kUart) = byte;
    }
    static std::uint32_t get_number() {
        const std::uint32_t low = get();
        return low | static_cast<std::uint32_t>(get()) << 8;
    }
    static void put_number(std::size_t number) {
        put(static_cast<std::uint8_t>(number));
        put(static_cast<std::uint8_t>(number >> 8));
    }

    PlainPlant plant_;
    std::size_t unread_ = 0;
};

}  // namespace rig
