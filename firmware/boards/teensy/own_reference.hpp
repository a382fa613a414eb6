// The widest limits that the board of a reference rig takes, in its own counts. No host raises them: to change them
// is to build and flash. They are those of the shipped configuration with room for another zero and for a
// configuration that is a little wider. What is not set here is the host's to choose.
#pragma once

#include "../../core/profile_reference.hpp"

namespace rig::wiring {

inline ReferenceProfile::Settings own_limits() {
    ReferenceProfile::Settings own = ReferenceProfile::Settings::widest();
    own.gains.kp = 1;  // its sign alone: a command that rises with the spindle's count
    own.gains.limit = 3000;  // command, 1e-4 of full scale
    own.limits.max_current = 1000;  // mA
    own.limits.max_load_ma = 1500;
    own.limits.load_i2t = 2000000;  // mA^2 s
    own.limits.min_spindle = -4200;  // counts, 1304 a radian
    own.limits.max_spindle = 4200;
    own.limits.motor.max_motor_step = 320;  // counts a tick
    own.limits.motor.continuous_current = 600;
    own.limits.motor.i2t = 1000000;
    own.limits.loop.max_motor_jump = 1280;
    own.limits.loop.max_target_step = 20;
    own.limits.loop.max_following = 800;
    own.limits.loop.following_ticks = 500;
    own.limits.choice.stall_ticks = 3000;
    own.limits.choice.dry_ticks = 2000;
    own.limits.choice.watchdog_us = 250000;
    own.limits.choice.hold_command_e4 = 1000;
    own.limits.choice.hold_ticks = 30000;
    return own;
}

}  // namespace rig::wiring
