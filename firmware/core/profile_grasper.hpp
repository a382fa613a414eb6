// The profile of the 3-DOF grasper: three motors, each in a position loop over its own encoder, with its
// own guard; three current read-backs, three force sensors; 2 kHz. Its Python twin:
// drivers/teensy/grasper.py.
#pragma once

#include <cstddef>
#include <cstdint>

#include "control.hpp"
#include "loop_guard.hpp"
#include "motor_guard.hpp"
#include "safety_choice.hpp"
#include "sensor_guard.hpp"

namespace rig {

class GrasperProfile {
  public:
    static constexpr std::size_t kMotors = 3;
    static constexpr std::int64_t kTickUs = 500;
    static constexpr std::uint32_t kProtocolHash = protocol_hash(
        "rig teensy protocol 1, grasper\n",
        "1 SAMPLE: version u1, kind u1, status u2, sequence u4, tick_us u4, motor_1 i4, motor_2 "
        "i4, motor_3 i4, target_1 i4, target_2 i4, target_3 i4, current_1 i2, current_2 i2, "
        "current_3 i2, force_1 u2, force_2 u2, force_3 u2, command_1_e4 i2, command_2_e4 i2, "
        "command_3_e4 i2, dropped u2\n",
        "17 ARM: version u1, kind u1, sequence u2, kp_1 f8, ki_1 f8, kd_1 f8, velocity_filter_1 "
        "f8, limit_1 f8, kp_2 f8, ki_2 f8, kd_2 f8, velocity_filter_2 f8, limit_2 f8, kp_3 f8, "
        "ki_3 f8, kd_3 f8, velocity_filter_3 f8, limit_3 f8, max_current_1 i4, max_force_1 i4, "
        "min_motor_1 i4, max_motor_1 i4, max_motor_step_1 i4, continuous_current_1 i4, i2t_1 i4, "
        "stall_current_1 i4, stall_motion_1 i4, max_motor_jump_1 i4, max_following_1 i4, "
        "following_ticks_1 i4, full_scale_current_1 i4, current_offset_1 i4, max_current_error_1 "
        "i4, current_ticks_1 i4, frozen_current_1 i4, frozen_motion_1 i4, max_current_2 i4, "
        "max_force_2 i4, min_motor_2 i4, max_motor_2 i4, max_motor_step_2 i4, "
        "continuous_current_2 i4, i2t_2 i4, stall_current_2 i4, stall_motion_2 i4, "
        "max_motor_jump_2 i4, max_following_2 i4, following_ticks_2 i4, full_scale_current_2 i4, "
        "current_offset_2 i4, max_current_error_2 i4, current_ticks_2 i4, frozen_current_2 i4, "
        "frozen_motion_2 i4, max_current_3 i4, max_force_3 i4, min_motor_3 i4, max_motor_3 i4, "
        "max_motor_step_3 i4, continuous_current_3 i4, i2t_3 i4, stall_current_3 i4, "
        "stall_motion_3 i4, max_motor_jump_3 i4, max_following_3 i4, following_ticks_3 i4, "
        "full_scale_current_3 i4, current_offset_3 i4, max_current_error_3 i4, current_ticks_3 "
        "i4, frozen_current_3 i4, frozen_motion_3 i4, stall_ticks i4, saturated_ticks i4, "
        "stale_ticks i4, watchdog_us i4, safe_state i4, hold_command_e4 i4\n",
        "19 SETPOINTS: version u1, kind u1, sequence u2, 50 x (target_1 i4, target_2 i4, target_3 "
        "i4)\n");
    static constexpr std::size_t kArmSize = kMotors * (8 * 5 + 4 * 18) + 4 * 6;
    static constexpr std::size_t kSetpointSize = 4 * kMotors;
    static constexpr std::size_t kMaxSetpoints = 50;

    // What is sampled at the beginning of a tick, in counts; a motor's place is the same in each.
    struct Inputs {
        std::int32_t motor[kMotors] = {};
        std::int32_t current[kMotors] = {};
        std::int32_t force[kMotors] = {};
    };

    struct Setpoint {
        std::int32_t target[kMotors] = {};

        static Setpoint read(Reader& reader) {
            Setpoint setpoint;
            for (std::int32_t& target : setpoint.target) target = reader.i32();
            return setpoint;
        }
    };

    struct Outputs {
        std::int32_t command_e4[kMotors] = {};
        bool in_force = false;  // whether the current controllers are to be enabled
    };

    bool arm(Reader& reader) {
        Gains gains[kMotors];
        for (Gains& one : gains) one.read(reader);
        GrasperProfile fresh;
        for (Axis& axis : fresh.axes_) axis.limits.read(reader);
        fresh.choice_.read(reader);
        bool valid = fresh.choice_.valid();
        for (std::size_t k = 0; k < kMotors; ++k) {
            valid = valid && gains[k].valid() && fresh.axes_[k].limits.valid();
            fresh.axes_[k].controller.reset(gains[k]);
        }
        if (valid) *this = fresh;
        return valid;
    }

    const SafetyChoice& choice() const { return choice_; }

    bool allow(const Setpoint& setpoint) const {
        for (std::size_t k = 0; k < kMotors; ++k) {
            const AxisLimits& limits = axes_[k].limits;
            if (setpoint.target[k] < limits.min_motor || setpoint.target[k] > limits.max_motor) {
                return false;
            }
        }
        return true;
    }

    Crossing check(const Inputs& now) {
        for (std::size_t k = 0; k < 3 * kMotors; ++k) {
            if (count(now, k) == kMissing) return {kSensorMissing, channel(k), kMissing, 0, 0};
        }
        if (!primed_) {
            primed_ = true;
            for (std::size_t k = 0; k < kMotors; ++k) {
                axes_[k].guard.prime(now.motor[k]);
                axes_[k].loop.prime(now.motor[k], now.current[k]);
            }
            currents_.prime(now.current);
            forces_.prime(now.force);
        }
        for (std::size_t k = 0; k < kMotors; ++k) {
            const Crossing crossing = check_levels(now, k);
            if (crossing.code != kNoTrip) return crossing;
        }
        for (std::size_t k = 0; k < kMotors; ++k) {
            Axis& axis = axes_[k];
            const Crossing motion =
                axis.guard.check(axis.limits.motor, choice_.stall_ticks, kTickUs, now.motor[k],
                                 now.current[k], channel(k), channel(kMotors + k));
            if (motion.code != kNoTrip) return motion;
            const Crossing loop =
                axis.loop.check(axis.limits.loop, kTickUs, now.motor[k], now.motor[k],
                                now.current[k], {channel(k), channel(k), channel(kMotors + k)});
            if (loop.code != kNoTrip) return loop;
        }
        const Crossing current = currents_.check(choice_, kTickUs, now.current);
        return current.code != kNoTrip ? current : forces_.check(choice_, kTickUs, now.force);
    }

    // From now on every motor is to stay where it is, with a low command.
    Setpoint begin_to_hold(const Inputs& now) {
        for (Axis& axis : axes_) {
            axis.controller.limit_to(choice_.hold_command_e4);
            axis.guard.begin_to_hold();
            axis.loop.begin_to_hold();
        }
        currents_.begin_to_hold();
        forces_.begin_to_hold();
        return resting(now);
    }

    static Setpoint resting(const Inputs& now) {
        Setpoint setpoint;
        for (std::size_t k = 0; k < kMotors; ++k) setpoint.target[k] = now.motor[k];
        return setpoint;
    }

    Outputs drive(const Setpoint& setpoint, const Inputs& now) {
        Outputs outputs;
        outputs.in_force = true;
        for (std::size_t k = 0; k < kMotors; ++k) {
            outputs.command_e4[k] =
                axes_[k].controller.tick(setpoint.target[k], now.motor[k], now.motor[k]);
            axes_[k].loop.drove(setpoint.target[k], outputs.command_e4[k]);
        }
        return outputs;
    }

    bool saturated(const Inputs& now) const {
        return currents_.saturated(now.current) || forces_.saturated(now.force);
    }

    static void write(Writer& sample, const Inputs& now, const Setpoint& shown,
                      const Outputs& outputs) {
        for (std::int32_t motor : now.motor) sample.i32(motor);
        for (std::int32_t target : shown.target) sample.i32(target);
        for (std::int32_t current : now.current) sample.i16(clip16(current));
        for (std::int32_t force : now.force) sample.u16(clip_u16(force));
        for (std::int32_t command_e4 : outputs.command_e4) sample.i16(clip16(command_e4));
    }

  private:
    // In the order of the wire.
    struct AxisLimits {
        std::int32_t max_current = 0;
        std::int32_t max_force = 0;
        std::int32_t min_motor = 0;
        std::int32_t max_motor = 0;
        MotorLimits motor;
        LoopLimits loop;

        void read(Reader& reader) {
            for (std::int32_t* limit : {&max_current, &max_force, &min_motor, &max_motor}) {
                *limit = reader.i32();
            }
            motor.read(reader);
            loop.read(reader);
        }

        bool valid() const {
            return max_current >= 0 && max_force >= 0 && min_motor <= max_motor && motor.valid() &&
                   loop.valid();
        }
    };

    struct Axis {
        AxisLimits limits;
        MotorGuard guard;
        LoopGuard loop;
        Controller controller;
    };

    Crossing check_levels(const Inputs& now, std::size_t k) const {
        const AxisLimits& limits = axes_[k].limits;
        if (magnitude(now.current[k]) > limits.max_current) {
            return {kOverCurrent, channel(kMotors + k), now.current[k], limits.max_current, 0};
        }
        if (now.force[k] > limits.max_force) {
            return {kOverForce, channel(2 * kMotors + k), now.force[k], limits.max_force, 0};
        }
        if (now.motor[k] < limits.min_motor) {
            return {kMotorTravel, channel(k), now.motor[k], limits.min_motor, 0};
        }
        if (now.motor[k] > limits.max_motor) {
            return {kMotorTravel, channel(k), now.motor[k], limits.max_motor, 0};
        }
        return {};
    }

    static std::uint8_t channel(std::size_t k) { return static_cast<std::uint8_t>(k); }
    static std::int32_t count(const Inputs& now, std::size_t k) {
        if (k < kMotors) return now.motor[k];
        return k < 2 * kMotors ? now.current[k - kMotors] : now.force[k - 2 * kMotors];
    }

    static constexpr std::int32_t kForceMax = 4095;

    Axis axes_[kMotors];
    SafetyChoice choice_;
    SensorGuard<kMotors> currents_{kMotors, INT16_MIN, INT16_MAX};
    SensorGuard<kMotors> forces_{2 * kMotors, kMissing, kForceMax};
    bool primed_ = false;
};

}  // namespace rig
