// What every Teensy has in common, whatever is wired to it: its clock, its USB line, its interrupts.
#pragma once

#include <Arduino.h>

#include <cstddef>
#include <cstdint>

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
};

}  // namespace rig
