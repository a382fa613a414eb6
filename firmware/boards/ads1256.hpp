// An ADS1256 with cells at its differential inputs 0-1, 2-3 and so on, converted in turn, one a tick: `Pins` has
// clock(level), out(level), data(), ready() and wait_ns(time).
// Source: Texas Instruments, ADS1255/ADS1256 data sheet SBAS288K: timing p. 6, cycling p. 21, format p. 23,
// registers p. 30-32, commands p. 34-37.
#pragma once

#include <array>
#include <cstddef>

#include "load_cell.hpp"

namespace rig {

template <class Pins, std::size_t Cells>
class Ads1256 {
  public:
    static_assert(1 <= Cells && Cells <= 4, "the converter has four differential inputs");
    static constexpr std::uint32_t kLongestTicks = 20;

    Pins pins;

    // `gain` is 2 to its power: 6 is 64, +-78 mV at the 2.5 V reference of most modules.
    void begin(unsigned gain) {
        pins.clock(false);
        send(kReset);
        pins.wait_ns(1000000);
        send(kStopContinuous);
        // calibrates itself behind every change, buffered inputs; no clock output; 2000 conversions a second
        const std::array<std::uint8_t, 4> settings = {0x06, inputs(0), static_cast<std::uint8_t>(gain), 0xB0};
        send(kWrite | kFirstRegister);
        send(settings.size() - 1);
        for (std::uint8_t setting : settings) send(setting);
        send(kRead | 1);  // from the inputs on: the first register has bits of the chip's own
        send(settings.size() - 2);
        pins.wait_ns(kTurnNs);
        present_ = true;
        for (std::size_t k = 1; k < settings.size(); ++k) present_ = receive() == settings[k] && present_;
        send(kSelfCalibrate);
    }

    // Once a tick: takes the conversion that is ready; the next input's begins before it is read.
    void step() {
        if (!present_ || !pins.ready()) return;
        const std::size_t next = (converting_ + 1) % Cells;
        send(kWrite | 1);
        send(0);
        send(inputs(next));
        send(kSync);
        pins.wait_ns(kSyncNs);
        send(kWakeUp);
        send(kReadData);
        pins.wait_ns(kTurnNs);
        std::uint32_t bits = 0;
        for (int k = 0; k < 3; ++k) bits = bits << 8 | receive();
        newest_[converting_].take(bits);
        converting_ = next;
    }

    // Of each cell once a tick.
    std::int32_t count(std::size_t cell) { return newest_[cell].count(); }

  private:
    enum Command : unsigned {
        kWakeUp = 0x00, kReadData = 0x01, kStopContinuous = 0x0F, kRead = 0x10, kWrite = 0x50,
        kSelfCalibrate = 0xF0, kSync = 0xFC, kReset = 0xFE,
    };
    static constexpr unsigned kFirstRegister = 0;
    static constexpr int kTurnNs = 6600;  // t6, 50 periods of 7.68 MHz: before the converter answers
    static constexpr int kSyncNs = 3200;  // t11, 24 periods
    static constexpr int kHalfNs = 300;   // t1, 4 periods a bit

    static std::uint8_t inputs(std::size_t cell) {
        return static_cast<std::uint8_t>(2 * cell << 4 | (2 * cell + 1));
    }
    void send(unsigned byte) { exchange(byte); }
    std::uint32_t receive() { return exchange(0); }
    // Both sides change their line at the rising edge and read at the falling one.
    std::uint32_t exchange(unsigned byte) {
        std::uint32_t got = 0;
        for (int bit = 7; bit >= 0; --bit) {
            pins.out((byte >> bit & 1) != 0);
            pins.clock(true);
            pins.wait_ns(kHalfNs);
            got = got << 1 | (pins.data() ? 1 : 0);
            pins.clock(false);
            pins.wait_ns(kHalfNs);
        }
        return got;
    }

    std::array<NewestConversion<kLongestTicks>, Cells> newest_;
    std::size_t converting_ = 0;
    bool present_ = false;
};

}  // namespace rig
