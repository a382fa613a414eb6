// The parts of the Arduino core that the Teensy's layer uses, for a host: what was written can be seen,
// what is read can be set.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>

constexpr int LOW = 0, HIGH = 1, INPUT = 0, OUTPUT = 1, INPUT_PULLUP = 2;

struct FakeBoard {
    std::map<int, int> modes, levels, duties, analog;
    int locked = 0;
    std::uint32_t now_us = 0;
};
inline FakeBoard board;

inline void pinMode(int pin, int mode) { board.modes[pin] = mode; }
inline void digitalWrite(int pin, int level) { board.levels[pin] = level; }
inline int digitalRead(int pin) { return board.levels.count(pin) != 0 ? board.levels[pin] : HIGH; }
inline int analogRead(int pin) { return board.analog[pin]; }
inline void analogWrite(int pin, int duty) { board.duties[pin] = duty; }
inline void analogWriteFrequency(int, float) {}
inline void analogWriteResolution(int) {}
inline void analogReadResolution(int) {}
inline void analogReadAveraging(int) {}
inline std::uint32_t micros() { return board.now_us; }
inline void noInterrupts() { ++board.locked; }
inline void interrupts() { --board.locked; }

struct FakeSerial {
    std::deque<std::uint8_t> in, out;
    int room = 512;
    void begin(int) {}
    int available() const { return static_cast<int>(in.size()); }
    int read() {
        const int byte = in.front();
        in.pop_front();
        return byte;
    }
    int availableForWrite() const { return room; }
    std::size_t write(const std::uint8_t* data, std::size_t size) {
        out.insert(out.end(), data, data + size);
        return size;
    }
    void send_now() {}
};
inline FakeSerial Serial;

struct IntervalTimer {
    void (*function)() = nullptr;
    void priority(int) {}
    bool begin(void (*called)(), int) {
        function = called;
        return true;
    }
};
