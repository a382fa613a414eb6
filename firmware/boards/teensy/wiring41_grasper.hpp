// What is wired to which pin of a Teensy 4.1 at the 3-DOF grasper, and the scalings set in ESCON Studio.
// Motor 1 is the yaw's, 2 and 3 are those of jaw 1 and jaw 2. Nothing here is known from outside: change
// it to your grasper and flash.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../core/profile_grasper.hpp"
#include "../escon.hpp"
#include "crossbar41.hpp"

namespace rig::wiring {

constexpr char kSerial[] = "GRASPER";  // the chip's number follows
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

// This board has no DAC: set values are PWM, the size of the current as 10 to 90 % duty, 0 A at 10 % and below:
// a broken wire or a board without power asks for nothing. The sign is the direction line's.
constexpr int kSetPin[kMotors] = {22, 23, 33};
// Not pins 24 and 25: they are LPUART1, which the processor's boot ROM may drive.
constexpr int kEnablePin[kMotors] = {28, 29, 30};
constexpr int kDirectionPin[kMotors] = {20, 21, 6};  // high: positive current
constexpr int kReadyPin[kMotors] = {26, 27, 32};     // low where the controller is ready
constexpr int kStopPin = 9;  // emergency stop: a contact to ground that opens when it is pressed
constexpr int kAlivePin = 31;  // toggles while the chip is alive
constexpr float kPwmHz = 5000.0F;
constexpr int kSetBits = 12;
constexpr double kFullScaleA = 2.0;  // current of a full command; a positive command closes
constexpr std::uint32_t kReadyAfterTicks = 40;  // enable acts within 8 ms

constexpr EsconWiring kEscon{{0.1, 0.0, 0.9, 2.0}, 1.0, {0.0, -2.0, 3.3, 2.0}, 3.3, 2.0};

// The widest limits this board takes, in its own counts: those of the shipped configuration with some room. No
// host raises them; what is not set here is the host's to choose.
inline GrasperProfile::Settings own_limits() {
    GrasperProfile::Settings own = GrasperProfile::Settings::widest();
    for (std::size_t k = 0; k < kMotors; ++k) {
        own.gains[k].limit = 4000;  // command, 1e-4 of full scale
        AxisFields& axis = own.axes[k];
        axis.max_current = 1000;                   // mA
        axis.max_motor = k == 0 ? 33000 : 24000;   // counts, 21513 a radian of the joint
        axis.min_motor = -axis.max_motor;
        axis.motor.max_motor_step = 90;
        axis.motor.continuous_current = 600;
        axis.motor.i2t = 1000000;  // counts^2 s
        axis.loop.max_motor_jump = 360;
        axis.loop.max_target_step = 90;
        axis.loop.max_following = 1500;
        axis.loop.following_ticks = 200;
    }
    own.choice.stall_ticks = 6000;
    own.choice.dry_ticks = 4000;
    own.choice.watchdog_us = 250000;
    own.choice.hold_command_e4 = 1000;
    own.choice.hold_ticks = 60000;
    return own;
}

}  // namespace rig::wiring
