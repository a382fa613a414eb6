// The profile of the reference rig: one drive motor in a position loop over the spindle, one load motor
// given its current, three encoders, two torque channels; 1 kHz. Its Python twin: drivers/teensy/guard.py.
#pragma once

#include <cstdint>
#include <initializer_list>

#include "control.hpp"
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
        "jaw i4, target i4, proximal i2, distal i2, current i2, fsr u2, command_e4 i2, load_ma i2, "
        "dropped u2\n",
        "17 ARM: version u1, kind u1, sequence u2, kp f8, ki f8, kd f8, velocity_filter f8, limit "
        "f8, max_current i4, max_load_ma i4, max_proximal i4, max_distal i4, min_spindle i4, "
        "max_spindle i4, min_jaw i4, max_jaw i4, max_motor_step i4, continuous_current i4, i2t i4, "
        "stall_current i4, stall_motion i4, stall_ticks i4, saturated_ticks i4, stale_ticks i4, "
        "watchdog_us i4, safe_state i4, hold_command_e4 i4\n",
        "19 SETPOINTS: version u1, kind u1, sequence u2, 100 x (target i4, load_ma i2)\n");
    static constexpr std::size_t kArmSize = 8 * 5 + 4 * 19;
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
            sensors_.prime(converted);
        }
        const Crossing crossing = check_levels(now);
        if (crossing.code != kNoTrip) return crossing;
        const Crossing motion = motor_.check(limits_.motor, limits_.choice.stall_ticks, kTickUs,
                                             now.motor, now.current, 0, 5);
        return motion.code != kNoTrip ? motion
                                      : sensors_.check(limits_.choice, kTickUs, converted);
    }

    // From now on the spindle is to stay where it is, with a low command and no load.
    Setpoint begin_to_hold(const Inputs& now) {
        controller_.limit_to(limits_.choice.hold_command_e4);
        motor_.begin_to_hold();
        sensors_.begin_to_hold();
        return resting(now);
    }

    static Setpoint resting(const Inputs& now) { return {now.spindle, 0}; }

    Outputs drive(const Setpoint& setpoint, const Inputs& now) {
        return {controller_.tick(setpoint.target, now.spindle, now.motor), setpoint.load_ma, true};
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
        SafetyChoice choice;

        void read(Reader& reader) {
            for (std::int32_t* limit : {&max_current, &max_load_ma, &max_proximal, &max_distal,
                                        &min_spindle, &max_spindle, &min_jaw, &max_jaw}) {
                *limit = reader.i32();
            }
            motor.read(reader);
            choice.read(reader);
        }

        bool valid() const {
            for (std::int32_t size : {max_current, max_load_ma, max_proximal, max_distal}) {
                if (size < 0) return false;
            }
            return motor.valid() && choice.valid() && min_spindle <= max_spindle &&
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

    static constexpr std::int32_t kFsrMax = 4095;

    Limits limits_;
    Controller controller_;
    MotorGuard motor_;
    SensorGuard<3> sensors_{3, INT16_MIN, INT16_MAX};
    bool primed_ = false;
};

}  // namespace rig
