// What is wired to which pin of a Teensy 4.1 at the 3-DOF grasper, and the scalings set in ESCON Studio.
// Motor 1 is the yaw's, 2 and 3 are those of jaw 1 and jaw 2. Nothing here is known from outside: change
// it to your grasper and flash.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../escon.hpp"
#include "crossbar41.hpp"

namespace rig::wiring {

constexpr char kSerial[] = "TEENSY41-GRASPER-0001";
constexpr std::size_t kMotors = 3;

// Three of the four hardware decoders; 3.3 V logic.
constexpr int kMotorA[kMotors] = {0, 2, 7};
constexpr int kMotorB[kMotors] = {1, 3, 8};
static_assert(inputs_are_exclusive({kMotorA[0], kMotorB[0], kMotorA[1], kMotorB[1], kMotorA[2],
                                    kMotorB[2]}),
              "two encoder pins share an input of the crossbar, or one reaches no decoder");

constexpr int kSamplePriority = 32;  // above USB: its interrupts may wait, the sample may not

constexpr int kCurrentPin[kMotors] = {14, 15, 16};  // A0, A1, A2
constexpr int kForcePin[kMotors] = {17, 18, 19};    // A3, A4, A5: amplifiers of the FlexiForce A201
constexpr int kAdcBits = 12;

// This board has no DAC: set values are PWM, 10 to 90 % duty.
constexpr int kSetPin[kMotors] = {22, 23, 33};
// Not pins 24 and 25: they are LPUART1, which the processor's boot ROM may drive.
constexpr int kEnablePin[kMotors] = {28, 29, 30};
constexpr int kReadyPin[kMotors] = {26, 27, 32};
constexpr int kAlivePin = 31;  // toggles while the chip is alive
constexpr float kPwmHz = 5000.0F;
constexpr int kSetBits = 12;
constexpr double kFullScaleA = 2.0;  // current of a full command; a positive command closes
constexpr std::uint32_t kReadyAfterTicks = 40;  // enable acts within 8 ms

constexpr EsconWiring kEscon{{0.1, -2.0, 0.9, 2.0}, 1.0, {0.0, -2.0, 3.3, 2.0}, 3.3, 2.0};

}  // namespace rig::wiring
