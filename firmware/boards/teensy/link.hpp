// What every Teensy has in common, whatever is wired to it: its clock, its USB line, its interrupts.
#pragma once

#include <Arduino.h>
#include <avr/eeprom.h>

#include <cstddef>
#include <cstdint>

#include "../../core/protocol.hpp"

namespace rig {

class TeensyLink {
  public:
    // The sampling timer interrupts everything; what it shares is touched with interrupts off.
    class Lock {
      public:
        Lock() { noInterrupts(); }
        ~Lock() { interrupts(); }
        Lock(const Lock&) = delete;
        Lock& operator=(const Lock&) = delete;
    };

    // Counts the starts of this board, over its resets and its power.
    static std::uint32_t boot() {
        auto* at = reinterpret_cast<std::uint32_t*>(std::uintptr_t{kBootAddress});
        const std::uint32_t boot = eeprom_read_dword(at) + 1;
        eeprom_write_dword(at, boot);
        return boot;
    }

    // A board's own number behind the wiring's name: two boards with the same image differ.
    static const char* serial(const char* name) {
        static char text[kSerialSize + 1] = {};
        std::size_t size = 0;
        for (; size < kSerialSize - 9 && name[size] != '\0'; ++size) text[size] = name[size];
        text[size++] = '-';
#if defined(ARDUINO_TEENSY35)
        const std::uint32_t number = SIM_UIDML ^ SIM_UIDL;
#else
        const std::uint32_t number = HW_OCOTP_CFG0 ^ HW_OCOTP_CFG1;
#endif
        for (int nibble = 28; nibble >= 0; nibble -= 4) {
            text[size++] = "0123456789ABCDEF"[number >> nibble & 0xF];
        }
        text[size] = '\0';
        return text;
    }

    std::uint32_t now_us() { return micros(); }

    std::size_t read(std::uint8_t* out, std::size_t room) {
        std::size_t count = 0;
        while (count < room && Serial.available() > 0) {
            out[count++] = static_cast<std::uint8_t>(Serial.read());
        }
        return count;
    }

    // Only what fits: a write that waits for the host would stop the main loop.
    std::size_t write(const std::uint8_t* data, std::size_t size) {
        const int fits = Serial.availableForWrite();
        const std::size_t room = fits > 0 ? static_cast<std::size_t>(fits) : 0;
        const std::size_t asked = size < room ? size : room;
        const std::size_t count = Serial.write(data, asked);
        Serial.send_now();
        return count <= asked ? count : 0;  // the core gives -1, as a size, where USB is not there
    }

  private:
    static constexpr std::uintptr_t kBootAddress = 4;
};

}  // namespace rig
