// The profile of the reference rig: one drive motor in a position loop over the spindle, one load motor
// given its current, three encoders, two torque channels; 1 kHz. Its Python twin: drivers/teensy/guard.py.
#pragma once

#include <cstdint>
#include <initializer_list>

#include "control.hpp"
#include "encoder_pair.hpp"
#include "loop_guard.hpp"
#include "motor_guard.hpp"
#include "safety_choice.hpp"
#include "sensor_guard.hpp"

namespace rig {

class ReferenceProfile {
  public:
    static constexpr std::int64_t kTickUs = 1000;
    static constexpr std::uint32_t kProtocolHash = protocol_hash(
        "rig teensy protocol 1\n",
        "1 SAMPLE: version u1, kind u1, status u2, sequence u4, tick_us u4, motor i4, spindle i4, "
        "jaw i4, target i4, proximal i2, distal i2, current i2, fsr u2, command_e4 i2, load_ma "
        "i2, dropped u2\n",
        "17 ARM: version u1, kind u1, sequence u2, kp f8, ki f8, kd f8, velocity_filter f8, limit "
        "f8, max_current i4, max_load_ma i4, max_proximal i4, max_distal i4, min_spindle i4, "
        "max_spindle i4, min_jaw i4, max_jaw i4, max_motor_step i4, continuous_current i4, i2t "
        "i4, stall_current i4, stall_motion i4, max_motor_jump i4, max_following i4, "
        "following_ticks i4, full_scale_current i4, current_offset i4, max_current_error i4, "
        "current_ticks i4, frozen_current i4, frozen_motion i4, motor_per_turn i4, "
        "spindle_per_turn i4, jaw_per_turn i4, twist_e6 i4, stretch_e6 i4, max_twist i4, "
        "max_stretch i4, max_spindle_jump i4, max_jaw_jump i4, torque_e3 i4, max_still_torque i4, "
        "stall_ticks i4, saturated_ticks i4, stale_ticks i4, watchdog_us i4, safe_state i4, "
        "hold_command_e4 i4\n",
        "19 SETPOINTS: version u1, kind u1, sequence u2, 100 x (target i4, load_ma i2)\n");
    static constexpr std::size_t kArmSize = 8 * 5 + 4 * 39;
    static constexpr std::size_t kSetpointSize = 6;
    static constexpr std::size_t kMaxSetpoints = 100;

    // What is sampled at the beginning of a tick, in counts.
    struct Inputs {
        std::int32_t motor = 0;
        std::int32_t spindle = 0;
        std::int32_t jaw = 0;
        std::int32_t proximal = 0;
        std::int32_t distal = 0;
        std::int32_t current = 0;
        std::int32_t fsr = 0;
    };

    struct Setpoint {
        std::int32_t target = 0;
        std::int16_t load_ma = 0;

        static Setpoint read(Reader& reader) {
            Setpoint setpoint;
            setpoint.target = reader.i32();
            setpoint.load_ma = reader.i16();
            return setpoint;
        }
    };

    struct Outputs {
        std::int32_t command_e4 = 0;
        std::int32_t load_ma = 0;
        bool in_force = false;  // whether the current controllers are to be enabled
    };

    bool arm(Reader& reader) {
        Gains gains;
        gains.read(reader);
        Limits limits;
        limits.read(reader);
        if (!gains.valid() || !limits.valid()) return false;
        *this = ReferenceProfile();
        limits_ = limits;
        controller_.reset(gains);
        return true;
    }

    const SafetyChoice& choice() const { return limits_.choice; }

    bool allow(const Setpoint& setpoint) const {
        return -limits_.max_load_ma <= setpoint.load_ma && setpoint.load_ma <= limits_.max_load_ma &&
               limits_.min_spindle <= setpoint.target && setpoint.target <= limits_.max_spindle;
    }

    Crossing check(const Inputs& now) {
        const std::int32_t channels[6] = {now.motor,    now.spindle, now.jaw,
                                          now.proximal, now.distal,  now.current};
        for (std::uint8_t k = 0; k < 6; ++k) {
            if (channels[k] == kMissing) return {kSensorMissing, k, kMissing, 0, 0};
        }
        const std::int32_t converted[3] = {now.proximal, now.distal, now.current};
        if (!primed_) {
            primed_ = true;
            motor_.prime(now.motor);
            loop_.prime(now.motor, now.current);
            last_ = now;
            torque_mean_ = 256 * std::int64_t{now.proximal};
            sensors_.prime(converted);
        }
        const Crossing crossing = check_levels(now);
        if (crossing.code != kNoTrip) return crossing;
        const Crossing motion = motor_.check(limits_.motor, limits_.choice.stall_ticks, kTickUs,
                                             now.motor, now.current, 0, 5);
        if (motion.code != kNoTrip) return motion;
        const Crossing implausible = check_encoders(now);
        return implausible.code != kNoTrip ? implausible
                                           : sensors_.check(limits_.choice, kTickUs, converted);
    }

    // From now on the spindle is to stay where it is, with a low command and no load.
    Setpoint begin_to_hold(const Inputs& now) {
        controller_.limit_to(limits_.choice.hold_command_e4);
        motor_.begin_to_hold();
        loop_.begin_to_hold();
        sensors_.begin_to_hold();
        return resting(now);
    }

    static Setpoint resting(const Inputs& now) { return {now.spindle, 0}; }

    Outputs drive(const Setpoint& setpoint, const Inputs& now) {
        const std::int32_t command_e4 =
            controller_.tick(setpoint.target, now.spindle, now.motor);
        loop_.drove(setpoint.target, command_e4);
        return {command_e4, setpoint.load_ma, true};
    }

    bool saturated(const Inputs& now) const {
        return sensors_.saturated({now.proximal, now.distal, now.current}) || now.fsr >= kFsrMax;
    }

    static void write(Writer& sample, const Inputs& now, const Setpoint& shown,
                      const Outputs& outputs) {
        sample.i32(now.motor).i32(now.spindle).i32(now.jaw).i32(shown.target);
        sample.i16(clip16(now.proximal)).i16(clip16(now.distal)).i16(clip16(now.current));
        sample.u16(clip_u16(now.fsr));
        sample.i16(clip16(outputs.command_e4)).i16(clip16(outputs.load_ma));
    }

  private:
    // In the order of the wire.
    struct Limits {
        std::int32_t max_current = 0;
        std::int32_t max_load_ma = 0;
        std::int32_t max_proximal = 0;
        std::int32_t max_distal = 0;
        std::int32_t min_spindle = 0;
        std::int32_t max_spindle = 0;
        std::int32_t min_jaw = 0;
        std::int32_t max_jaw = 0;
        MotorLimits motor;
        LoopLimits loop;
        PairLimits twist;    // motor and spindle, twisted by the proximal torque
        PairLimits stretch;  // jaw and spindle, by the distal torque
        std::int32_t max_spindle_jump = 0;
        std::int32_t max_jaw_jump = 0;
        std::int32_t torque_e3 = 0;  // proximal counts, signed, for 1000 counts of current at rest
        std::int32_t max_still_torque = 0;
        SafetyChoice choice;

        void read(Reader& reader) {
            for (std::int32_t* limit : {&max_current, &max_load_ma, &max_proximal, &max_distal,
                                        &min_spindle, &max_spindle, &min_jaw, &max_jaw}) {
                *limit = reader.i32();
            }
            motor.read(reader);
            loop.read(reader);
            for (std::int32_t* limit :
                 {&twist.first_per_turn, &twist.second_per_turn, &stretch.first_per_turn,
                  &twist.twist_e6, &stretch.twist_e6, &twist.window, &stretch.window,
                  &max_spindle_jump, &max_jaw_jump, &torque_e3, &max_still_torque}) {
                *limit = reader.i32();
            }
            stretch.second_per_turn = twist.second_per_turn;
            choice.read(reader);
        }

        bool valid() const {
            for (std::int32_t size : {max_current, max_load_ma, max_proximal, max_distal,
                                      max_spindle_jump, max_jaw_jump, max_still_torque}) {
                if (size < 0) return false;
            }
            return motor.valid() && loop.valid() && twist.valid() && stretch.valid() && choice.valid() && min_spindle <= max_spindle &&
                   min_jaw <= max_jaw;
        }
    };

    Crossing check_levels(const Inputs& now) const {
        if (magnitude(now.current) > limits_.max_current) {
            return {kOverCurrent, 5, now.current, limits_.max_current, 0};
        }
        if (magnitude(now.proximal) > limits_.max_proximal) {
            return {kProximalTorque, 3, now.proximal, limits_.max_proximal, 0};
        }
        if (magnitude(now.distal) > limits_.max_distal) {
            return {kDistalTorque, 4, now.distal, limits_.max_distal, 0};
        }
        if (now.spindle < limits_.min_spindle) {
            return {kSpindleTravel, 1, now.spindle, limits_.min_spindle, 0};
        }
        if (now.spindle > limits_.max_spindle) {
            return {kSpindleTravel, 1, now.spindle, limits_.max_spindle, 0};
        }
        if (now.jaw < limits_.min_jaw) return {kJawTravel, 2, now.jaw, limits_.min_jaw, 0};
        if (now.jaw > limits_.max_jaw) return {kJawTravel, 2, now.jaw, limits_.max_jaw, 0};
        return {};
    }

    // What the encoders and the current say of one another.
    Crossing check_encoders(const Inputs& now) {
        const std::int64_t spindle_step = std::int64_t{now.spindle} - last_.spindle;
        const std::int64_t jaw_step = std::int64_t{now.jaw} - last_.jaw;
        last_ = now;
        if (exceeds(spindle_step, limits_.max_spindle_jump)) {
            return {kEncoderJump, 1, spindle_step, limits_.max_spindle_jump, 0};
        }
        if (exceeds(jaw_step, limits_.max_jaw_jump)) {
            return {kEncoderJump, 2, jaw_step, limits_.max_jaw_jump, 0};
        }
        const Crossing twist = twist_.check(limits_.twist, now.motor, now.spindle, now.proximal, 0);
        if (twist.code != kNoTrip) return twist;
        const Crossing stretch = stretch_.check(limits_.stretch, now.jaw, now.spindle, now.distal, 2);
        if (stretch.code != kNoTrip) return stretch;
        const Crossing loop =
            loop_.check(limits_.loop, kTickUs, now.spindle, now.motor, now.current, {1, 0, 5});
        return loop.code != kNoTrip ? loop : check_rest(now);
    }

    // A motor at rest holds the torque that its current makes, but for friction; one whose current is
    // not found again as torque turns, whatever its encoder counts.
    Crossing check_rest(const Inputs& now) {
        torque_mean_ += (256 * std::int64_t{now.proximal} - torque_mean_) / 5;
        if (limits_.torque_e3 == 0 || !loop_.still()) return {};
        const std::int64_t made = loop_.mean_current() * limits_.torque_e3 / 1000;
        const std::int64_t unfound = made - torque_mean_ / 256;
        if (!exceeds(unfound, limits_.max_still_torque)) return {};
        return {kEncoderFrozen, 0, unfound, limits_.max_still_torque, 0};
    }

    static constexpr std::int32_t kFsrMax = 4095;

    Limits limits_;
    Controller controller_;
    MotorGuard motor_;
    LoopGuard loop_;
    EncoderPair twist_;
    EncoderPair stretch_;
    Inputs last_;
    std::int64_t torque_mean_ = 0;  // in parts of a count
    SensorGuard<3> sensors_{3, INT16_MIN, INT16_MAX};
    bool primed_ = false;
};

}  // namespace rig
