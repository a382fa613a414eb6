// A Teensy at the reference rig as `rig::App` wants its hardware; the 4.1 unless the 3.5 is compiled for.
// Nothing has run on a board yet: it is compiled, and tried on a host against tests/arduino, which stands
// for the parts of the Arduino core used here.
#pragma once

#include <Arduino.h>

#include "../../core/app.hpp"
#include "../../core/profile_reference.hpp"
#include "link.hpp"
#if defined(ARDUINO_TEENSY35)
#include "counters35.hpp"
#else
#include "counters41.hpp"
#endif

namespace rig {

// Needs nothing that a fault may have broken.
inline void motors_off() {
    for (int pin : {wiring::kDriveEnablePin, wiring::kLoadEnablePin}) {
        pinMode(pin, OUTPUT);
        digitalWrite(pin, LOW);
    }
}

}  // namespace rig

#include "watch.hpp"

namespace rig {

class ReferenceHardware : public TeensyLink {
  public:
    using Profile = ReferenceProfile;
    using Inputs = Profile::Inputs;
    using Outputs = Profile::Outputs;

    // Motors off first, whatever else fails.
    void begin() {
        motors_off();
        take_faults();
        analogWriteResolution(wiring::kSetBits);
        if constexpr (wiring::kPwmHz > 0) {
            for (int pin : {wiring::kDriveSetPin, wiring::kLoadSetPin}) {
                analogWriteFrequency(pin, wiring::kPwmHz);
            }
        }
        for (int pin : {wiring::kDriveDirectionPin, wiring::kLoadDirectionPin}) pinMode(pin, OUTPUT);
        drive(Outputs());
        for (int pin : {wiring::kDriveReadyPin, wiring::kLoadReadyPin, wiring::kStopPin}) {
            pinMode(pin, INPUT_PULLUP);
        }
        analogReadResolution(wiring::kAdcBits);
        analogReadAveraging(4);
        encoders_.begin();
        pinMode(wiring::kSpindleIndex, INPUT_PULLDOWN);
        attachInterrupt(digitalPinToInterrupt(wiring::kSpindleIndex), on_index, RISING);
        torques_.begin();
        Serial.begin(115200);  // the rate has no effect on USB
    }

    void begin_watch() { watch_.begin(); }
    void feed() { watch_.feed(); }

    bool stopped() { return digitalRead(wiring::kStopPin) == HIGH; }

    Inputs sample() {
        Inputs counts;
        counts.motor = encoders_.motor();
        counts.spindle = encoders_.spindle();
        counts.jaw = encoders_.jaw();
        const Torques torques = torques_.sample();
        counts.proximal = torques.proximal;
        counts.distal = torques.distal;
        counts.current = ready() ? wiring::kDrive.milliampere(analogRead(wiring::kDriveCurrentPin))
                                       : kMissing;
        counts.fsr = analogRead(wiring::kFsrPin);
        counts.indexed = index_came_;
        index_came_ = false;
        return counts;
    }

    void drive(const Outputs& outputs) {
        const double drive_a = 1e-4 * outputs.command_e4 * wiring::kDriveFullScaleA;
        const double load_a = 1e-3 * outputs.load_ma;
        digitalWrite(wiring::kDriveDirectionPin, drive_a < 0 ? LOW : HIGH);
        digitalWrite(wiring::kLoadDirectionPin, load_a < 0 ? LOW : HIGH);
        analogWrite(wiring::kDriveSetPin, wiring::kDrive.code(drive_a));
        analogWrite(wiring::kLoadSetPin, wiring::kLoad.code(load_a));
        digitalWrite(wiring::kDriveEnablePin, outputs.in_force ? HIGH : LOW);
        digitalWrite(wiring::kLoadEnablePin, outputs.in_force ? HIGH : LOW);
        enabled_ticks_ = outputs.in_force ? enabled_ticks_ + 1 : 0;
    }

  private:
    // Either controller that is not ready after it was enabled makes the current missing. A broken wire or a
    // controller without power leaves the line high, which is not ready.
    bool ready() const {
        return enabled_ticks_ < wiring::kReadyAfterTicks ||
               (digitalRead(wiring::kDriveReadyPin) == LOW && digitalRead(wiring::kLoadReadyPin) == LOW);
    }

    // A short disturbance is over before the interrupt reads the line.
    static void on_index() { index_came_ = index_came_ || digitalReadFast(wiring::kSpindleIndex) == HIGH; }

    static inline volatile bool index_came_ = false;
    Counters encoders_;
    wiring::TorquePins torques_;
    ChipWatch watch_;
    std::uint32_t enabled_ticks_ = 0;
};

}  // namespace rig
