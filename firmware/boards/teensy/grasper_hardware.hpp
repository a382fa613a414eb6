// A Teensy 4.1 at the 3-DOF grasper as `rig::App` wants its hardware. Like the reference rig's it has run
// on no board yet: it is compiled, and tried on a host against tests/arduino.
#pragma once

#include <Arduino.h>
#include <QuadEncoder.h>

#include "../../core/app.hpp"
#include "../../core/profile_grasper.hpp"
#include "encoder_filter41.hpp"
#include "link.hpp"
#include "wiring41_grasper.hpp"

namespace rig {

// Needs nothing that a fault may have broken.
inline void motors_off() {
    for (int pin : wiring::kEnablePin) {
        pinMode(pin, OUTPUT);
        digitalWrite(pin, LOW);
    }
}

}  // namespace rig

#include "watch.hpp"

#if defined(ARDUINO_TEENSY35)
#error "The grasper needs three hardware decoders: a Teensy 4.1"
#endif

namespace rig {

class GrasperHardware : public TeensyLink {
  public:
    using Profile = GrasperProfile;
    using Inputs = Profile::Inputs;
    using Outputs = Profile::Outputs;

    // Motors off first, whatever else fails.
    void begin() {
        motors_off();
        take_faults();
        analogWriteResolution(wiring::kSetBits);
        for (int pin : wiring::kSetPin) analogWriteFrequency(pin, wiring::kPwmHz);
        for (int pin : wiring::kDirectionPin) pinMode(pin, OUTPUT);
        drive(Outputs());
        for (int pin : wiring::kReadyPin) pinMode(pin, INPUT_PULLUP);
        pinMode(wiring::kStopPin, INPUT_PULLUP);
        analogReadResolution(wiring::kAdcBits);
        analogReadAveraging(4);
        for (QuadEncoder& encoder : encoders_) {
            filter(encoder);
            encoder.init();
        }
        Serial.begin(115200);  // the rate has no effect on USB
    }

    void begin_watch() { watch_.begin(); }
    void feed() { watch_.feed(); }

    bool stopped() { return digitalRead(wiring::kStopPin) == HIGH; }

    Inputs sample() {
        Inputs counts;
        for (std::size_t k = 0; k < Profile::kMotors; ++k) {
            counts.motor[k] = encoders_[k].read();
            counts.current[k] =
                ready(k) ? wiring::kEscon.milliampere(analogRead(wiring::kCurrentPin[k])) : kMissing;
            counts.force[k] = analogRead(wiring::kForcePin[k]);
        }
        return counts;
    }

    void drive(const Outputs& outputs) {
        for (std::size_t k = 0; k < Profile::kMotors; ++k) {
            const double current_a = 1e-4 * outputs.command_e4[k] * wiring::kFullScaleA;
            digitalWrite(wiring::kDirectionPin[k], current_a < 0 ? LOW : HIGH);
            analogWrite(wiring::kSetPin[k], wiring::kEscon.code(current_a));
            digitalWrite(wiring::kEnablePin[k], outputs.in_force ? HIGH : LOW);
        }
        enabled_ticks_ = outputs.in_force ? enabled_ticks_ + 1 : 0;
    }

  private:
    // A controller that is not ready after it was enabled reports no current; a broken wire leaves the line high.
    bool ready(std::size_t k) const {
        return enabled_ticks_ < wiring::kReadyAfterTicks ||
               digitalRead(wiring::kReadyPin[k]) == LOW;
    }

    QuadEncoder encoders_[Profile::kMotors] = {{1, wiring::kMotorA[0], wiring::kMotorB[0]},
                                               {2, wiring::kMotorA[1], wiring::kMotorB[1]},
                                               {3, wiring::kMotorA[2], wiring::kMotorB[2]}};
    ChipWatch watch_;
    std::uint32_t enabled_ticks_ = 0;
};

}  // namespace rig
