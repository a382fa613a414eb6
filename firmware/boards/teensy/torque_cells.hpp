// Where the two torques come from: amplifiers at the board's own 12-bit converter, an ADS1256 with both cells, or an
// HX711 for each. The wiring names one.
#pragma once

#include <Arduino.h>

#include "../ads1256.hpp"
#include "../hx711.hpp"

namespace rig {

struct Torques {
    std::int32_t proximal = kMissing;
    std::int32_t distal = kMissing;
};

// What has no pin is left out.
template <int Clock, int Data, int Out = -1, int Ready = -1>
struct ConverterPins {
    static void begin() {
        pinMode(Clock, OUTPUT);
        pinMode(Data, INPUT_PULLUP);  // a converter that is not there is not ready
        if (Out >= 0) pinMode(Out, OUTPUT);
        if (Ready >= 0) pinMode(Ready, INPUT_PULLUP);
    }
    static void clock(bool level) { digitalWriteFast(Clock, level); }
    static void out(bool level) { digitalWriteFast(Out, level); }
    static bool data() { return digitalReadFast(Data) != 0; }
    static bool ready() { return digitalReadFast(Ready) == 0; }
    static void wait_ns(int time) { delayNanoseconds(static_cast<std::uint32_t>(time)); }
};

template <int Proximal, int Distal, int Zero>
class AnalogCells {
  public:
    void begin() {}
    Torques sample() { return {torque(Proximal), torque(Distal)}; }

  private:
    // Spread over the 16 bits of a sample, so that the ends of the converter are those of the field.
    static std::int32_t torque(int pin) {
        const std::int32_t reading = analogRead(pin) - Zero;
        return reading >= Zero - 1 ? INT16_MAX : reading * 16;
    }
};

template <class Pins>
class AdsCells {
  public:
    void begin() {
        Pins::begin();
        converter_.begin(kGain);
    }
    Torques sample() {
        converter_.step();
        const std::int32_t proximal = converter_.count(0);
        return {proximal, converter_.count(1)};
    }

  private:
    static constexpr unsigned kGain = 6;  // 64
    Ads1256<Pins, 2> converter_;
};

template <class Proximal, class Distal>
class HxCells {
  public:
    void begin() {
        Proximal::begin();
        Distal::begin();
        proximal_.begin();
        distal_.begin();
    }
    Torques sample() {
        const std::int32_t proximal = proximal_.read();
        return {proximal, distal_.read()};
    }

  private:
    Hx711<Proximal> proximal_;
    Hx711<Distal> distal_;
};

}  // namespace rig
