// The profile of the 3-DOF grasper: three motors, each in a position loop over its own encoder, with its
// own guard; three current read-backs, three force sensors; 2 kHz.
#pragma once

#include <cstddef>
#include <cstdint>

#include "control.hpp"
#include "limits.hpp"
#include "loop_guard.hpp"
#include "motor_guard.hpp"
#include "sensor_guard.hpp"

namespace rig {

class GrasperProfile {
  public:
    static constexpr std::size_t kMotors = 3;
    static constexpr std::int64_t kTickUs = grasper::kTickUs;
    static constexpr std::uint32_t kProtocolHash = crc32(grasper::kContract);
    static constexpr std::size_t kArmSize = grasper::kArmSize;
    static constexpr std::size_t kSetpointSize = grasper::kSetpointSize;
    static constexpr std::size_t kMaxSetpoints = grasper::kMaxSetpoints;

    // What a host arms the board with, and what a board is built with.
    struct Settings {
        Gains gains[kMotors];
        AxisFields axes[kMotors];
        ChoiceFields choice;

        static Settings widest() {
            Settings settings;
            for (std::size_t k = 0; k < kMotors; ++k) {
                settings.gains[k].limit = kFullScaleE4;
                settings.axes[k] = rig::widest<AxisFields>();
            }
            settings.choice = rig::widest<ChoiceFields>();
            return settings;
        }
        void read(Reader& reader) {
            for (Gains& one : gains) one.read(reader);
            for (AxisFields& axis : axes) rig::read(reader, axis);
            rig::read(reader, choice);
        }
        bool seeks() const { return choice.seek != 0; }  // no grasper does
        bool valid() const {
            bool valid = choice_is_valid(choice) && !seeks();
            for (std::size_t k = 0; k < kMotors; ++k) {
                valid = valid && gains[k].valid() && sizes_are_valid(axes[k]) &&
                        axes[k].min_motor <= axes[k].max_motor;
            }
            return valid;
        }
        bool within(const Settings& own) const {
            bool inside = rig::within(choice, own.choice);
            for (std::size_t k = 0; k < kMotors; ++k) {
                inside = inside && gains[k].within(own.gains[k]) && rig::within(axes[k], own.axes[k]);
            }
            return inside;
        }
    };

    // What is sampled at the beginning of a tick, in counts; a motor's place is the same in each.
    struct Inputs {
        std::int32_t motor[kMotors] = {};
        std::int32_t current[kMotors] = {};
        std::int32_t force[kMotors] = {};
    };

    static bool indexed(const Inputs&) { return false; }  // none is wired
    static std::int32_t& encoder(Inputs& inputs, std::size_t k) { return inputs.motor[k]; }

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

    // Takes the settings of a host and forgets what was watched, but not the motors' heat.
    void begin(const Settings& settings) {
        GrasperProfile fresh;
        fresh.choice_ = settings.choice;
        for (std::size_t k = 0; k < kMotors; ++k) {
            fresh.axes_[k].heat = axes_[k].heat;
            fresh.axes_[k].limits = settings.axes[k];
            fresh.axes_[k].controller.reset(settings.gains[k]);
        }
        *this = fresh;
    }

    const ChoiceFields& choice() const { return choice_; }

    void assume_hot() {
        for (Axis& axis : axes_) axis.heat.assume_hot();
    }
    bool too_hot(const Settings& settings) {
        bool hot = false;
        for (std::size_t k = 0; k < kMotors; ++k) {
            const MotorFields& limits = settings.axes[k].motor;
            axes_[k].heat.settle(limits.continuous_current, limits.i2t);
            hot = hot || axes_[k].heat.too_hot(limits.i2t);
        }
        return hot;
    }

    // Armed or not: what `ticks` ticks with these currents did to the motors.
    void warm(const Inputs& now, std::int64_t ticks) {
        for (std::size_t k = 0; k < kMotors; ++k) {
            axes_[k].heat.take(axes_[k].limits.motor.continuous_current, kTickUs, ticks,
                               now.current[k]);
        }
    }

    void late(const Inputs& now, std::int64_t ticks) {
        for (std::size_t k = 0; primed_ && k < kMotors; ++k) {
            if (now.motor[k] == kMissing) continue;
            axes_[k].guard.late(now.motor[k], ticks);
            axes_[k].loop.late(now.motor[k], ticks);
            axes_[k].controller.late(now.motor[k], ticks);
        }
    }

    bool allow(const Setpoint& setpoint) const {
        bool allowed = true;
        for (std::size_t k = 0; k < kMotors; ++k) {
            const AxisFields& limits = axes_[k].limits;
            allowed = allowed && limits.min_motor <= setpoint.target[k] &&
                      setpoint.target[k] <= limits.max_motor;
        }
        return allowed;
    }
    bool follows(const Setpoint& setpoint, const Setpoint& before) const {
        bool near = true;
        for (std::size_t k = 0; k < kMotors; ++k) {
            near = near && !exceeds(std::int64_t{setpoint.target[k]} - before.target[k],
                                    axes_[k].limits.loop.max_target_step);
        }
        return near;
    }
    // A first setpoint far from where a motor stands would make it leap.
    Crossing leap(const Setpoint& setpoint, const Inputs& now) const {
        for (std::size_t k = 0; k < kMotors; ++k) {
            const std::int64_t far = std::int64_t{setpoint.target[k]} - now.motor[k];
            const std::int32_t most = axes_[k].limits.loop.max_following;
            if (exceeds(far, most)) return {kFollowingError, channel(k), far, most, 0};
        }
        return {};
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
            const Crossing heat =
                axis.heat.check(axis.limits.motor.i2t, kTickUs, channel(kMotors + k));
            if (heat.code != kNoTrip) return heat;
            const Crossing motion = axis.guard.check(axis.limits.motor, choice_.stall_ticks, kTickUs,
                                                     now.motor[k], now.current[k], channel(k));
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
    struct Axis {
        AxisFields limits = widest<AxisFields>();
        Heat heat;
        MotorGuard guard;
        LoopGuard loop;
        Controller controller;
    };

    Crossing check_levels(const Inputs& now, std::size_t k) const {
        const AxisFields& limits = axes_[k].limits;
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
    ChoiceFields choice_ = widest<ChoiceFields>();
    SensorGuard<kMotors> currents_{kMotors, INT16_MIN, INT16_MAX};
    SensorGuard<kMotors> forces_{2 * kMotors, kMissing, kForceMax, 0};
    bool primed_ = false;
};

}  // namespace rig
