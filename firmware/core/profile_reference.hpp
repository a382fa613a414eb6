// The profile of the reference rig: one drive motor in a position loop over the spindle, one load motor
// given its current, three encoders, two torque channels; 1 kHz.
#pragma once

#include <cstddef>
#include <cstdint>

#include "control.hpp"
#include "encoder_pair.hpp"
#include "end_probe.hpp"
#include "limits.hpp"
#include "loop_guard.hpp"
#include "motor_guard.hpp"
#include "rest_guard.hpp"
#include "sensor_guard.hpp"

namespace rig {

class ReferenceProfile {
  public:
    static constexpr std::int64_t kTickUs = reference::kTickUs;
    static constexpr std::uint32_t kProtocolHash = crc32(reference::kContract);
    static constexpr std::size_t kArmSize = reference::kArmSize;
    static constexpr std::size_t kSetpointSize = reference::kSetpointSize;
    static constexpr std::size_t kMaxSetpoints = reference::kMaxSetpoints;

    // What a host arms the board with, and what a board is built with.
    struct Settings {
        Gains gains;
        ReferenceFields limits;

        static Settings widest() {
            return {{0, 0, 0, 0, kFullScaleE4}, rig::widest<ReferenceFields>()};
        }
        void read(Reader& reader) {
            gains.read(reader);
            rig::read(reader, limits);
        }
        bool valid() const {
            return gains.valid() && sizes_are_valid(limits) && choice_is_valid(limits.choice) &&
                   limits.min_spindle <= limits.max_spindle && limits.min_jaw <= limits.max_jaw &&
                   (!seeks() || gains.limit <= limits.choice.hold_command_e4);
        }
        // Whether it is to find its zeros by moving gently against a stop.
        bool seeks() const { return limits.choice.seek != 0; }
        bool within(const Settings& own) const {
            return gains.within(own.gains) && rig::within(limits, own.limits);
        }
    };

    // What is sampled at the beginning of a tick, in counts.
    struct Inputs {
        std::int32_t motor = 0;
        std::int32_t spindle = 0;
        std::int32_t jaw = 0;
        std::int32_t proximal = 0;
        std::int32_t distal = 0;
        std::int32_t current = 0;
        std::int32_t fsr = 0;
        bool indexed = false;  // the index of the spindle's encoder came since the last sample
    };

    static bool indexed(const Inputs& inputs) { return inputs.indexed; }

    static std::int32_t& encoder(Inputs& inputs, std::size_t k) {
        return k == 0 ? inputs.motor : k == 1 ? inputs.spindle : inputs.jaw;
    }

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

    // Takes the settings of a host and forgets what was watched, but not the motors' heat.
    void begin(const Settings& settings) {
        const Heat heat = heat_;
        const Heat load_heat = load_heat_;
        *this = ReferenceProfile();
        heat_ = heat;
        load_heat_ = load_heat;
        limits_ = settings.limits;
        controller_.reset(settings.gains);
        twist_limits_ = {limits_.motor_per_turn, limits_.spindle_per_turn, limits_.twist_e6,
                         limits_.max_twist, 0, 1};
        stretch_limits_ = {limits_.jaw_per_turn, limits_.spindle_per_turn, limits_.stretch_e6,
                           limits_.max_stretch, kJawLateTicks, kJawMeanTicks};
        rest_limits_ = {limits_.torque_e3, limits_.twist_e6 < 0 ? -1 : 1, limits_.max_still_torque,
                        limits_.max_still_change, limits_.max_still_rise};
        probe_limits_ = {limits_.min_spindle, limits_.max_spindle, limits_.probe_within,
                         limits_.probe_patience, pull_of(settings)};
    }

    const ChoiceFields& choice() const { return limits_.choice; }

    void assume_hot() {
        heat_.assume_hot();
        load_heat_.assume_hot();
    }
    bool too_hot(const Settings& settings) {
        const ReferenceFields& limits = settings.limits;
        heat_.settle(limits.motor.continuous_current, limits.motor.i2t);
        load_heat_.settle(limits.continuous_load_ma, limits.load_i2t);
        return heat_.too_hot(limits.motor.i2t) || load_heat_.too_hot(limits.load_i2t);
    }

    // Armed or not: what `ticks` ticks with this current did to the motors.
    void warm(const Inputs& now, std::int64_t ticks) {
        heat_.take(limits_.motor.continuous_current, kTickUs, ticks, now.current);
        load_heat_.take(limits_.continuous_load_ma, kTickUs, ticks, load_ma_);
        load_ma_ = 0;  // until a tick asks for some
    }

    void late(const Inputs& now, std::int64_t ticks) {
        if (!primed_ || now.motor == kMissing) return;
        motor_.late(now.motor, ticks);
        loop_.late(now.motor, ticks);
        controller_.late(now.motor, ticks);
        if (now.spindle != kMissing) last_.spindle = late(now.spindle, last_.spindle, ticks);
        if (now.jaw != kMissing) last_.jaw = late(now.jaw, last_.jaw, ticks);
    }

    bool allow(const Setpoint& setpoint) const {
        return -limits_.max_load_ma <= setpoint.load_ma && setpoint.load_ma <= limits_.max_load_ma &&
               limits_.min_spindle <= setpoint.target && setpoint.target <= limits_.max_spindle;
    }
    bool follows(const Setpoint& setpoint, const Setpoint& before) const {
        return !exceeds(std::int64_t{setpoint.target} - before.target, limits_.loop.max_target_step);
    }
    // A first setpoint far from where the spindle stands would make it leap.
    Crossing leap(const Setpoint& setpoint, const Inputs& now) const {
        const std::int64_t far = std::int64_t{setpoint.target} - now.spindle;
        if (!exceeds(far, limits_.loop.max_following)) return {};
        return {kFollowingError, 1, far, limits_.loop.max_following, 0};
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
            sensors_.prime(converted);
        }
        const Crossing crossing = check_levels(now);
        if (crossing.code != kNoTrip) return crossing;
        const Crossing heat = heat_.check(limits_.motor.i2t, kTickUs, 5);
        if (heat.code != kNoTrip) return heat;
        const Crossing load = load_heat_.check(limits_.load_i2t, kTickUs, kLoadChannel);
        if (load.code != kNoTrip) return load;
        const Crossing motion = motor_.check(limits_.motor, limits_.choice.stall_ticks, kTickUs,
                                             now.motor, now.current, 0);
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
            probe_.drive(probe_limits_, setpoint.target, now.spindle, rest_.still_ticks(),
                         controller_.tick(setpoint.target, now.spindle, now.motor));
        loop_.drove(setpoint.target, command_e4);
        load_ma_ = setpoint.load_ma;
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
    static constexpr std::uint8_t kLoadChannel = 6;
    static constexpr std::int32_t kJawLateTicks = 30;
    static constexpr std::int32_t kJawMeanTicks = 16;  // a period of the cable with the jaw's inertia

    static std::int32_t late(std::int32_t now, std::int32_t last, std::int64_t ticks) {
        return static_cast<std::int32_t>(now - (std::int64_t{now} - last) / ticks);
    }

    // The command that overcomes any friction, even where the torque constant is half of what is declared.
    static std::int32_t pull_of(const Settings& settings) {
        const ReferenceFields& limits = settings.limits;
        const std::int64_t made = magnitude(std::int64_t{limits.torque_e3} * limits.loop.full_scale_current);
        if (made == 0 || limits.max_still_torque == INT32_MAX) return 0;
        const double most = settings.gains.limit;
        const double pull = 1e7 * kDoubt * limits.max_still_torque / static_cast<double>(made);
        const auto size = static_cast<std::int32_t>(pull < most ? pull : most);
        return settings.gains.kp < 0 ? -size : size;
    }

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
        const Crossing twist = twist_.check(twist_limits_, now.motor, now.spindle, now.proximal, 0);
        if (twist.code != kNoTrip) return twist;
        const Crossing stretch = stretch_.check(stretch_limits_, now.jaw, now.spindle, now.distal, 2);
        if (stretch.code != kNoTrip) return stretch;
        const Crossing travel = check_travel_by_jaw(now);
        if (travel.code != kNoTrip) return travel;
        const Crossing loop =
            loop_.check(limits_.loop, kTickUs, now.spindle, now.motor, now.current, {1, 0, 5});
        if (loop.code != kNoTrip) return loop;
        const Crossing rest = rest_.check(rest_limits_, kTickUs, {now.motor, now.spindle, now.jaw},
                                          now.proximal, now.current);
        return rest.code != kNoTrip ? rest : probe_.check(kTickUs, rest_.still_ticks());
    }

    // Where the jaw is, the spindle cannot be far beyond its travel, whatever the motor and it count.
    Crossing check_travel_by_jaw(const Inputs& now) const {
        if (limits_.jaw_per_turn == 0 || limits_.max_beyond == INT32_MAX) return {};
        const std::int64_t turned =
            std::int64_t{now.jaw} - limits_.jaw_zero - twist_of(stretch_limits_, now.distal);
        const std::int64_t spindle = turned * limits_.spindle_per_turn / limits_.jaw_per_turn;
        const std::int64_t least = std::int64_t{limits_.min_spindle} - limits_.max_beyond;
        const std::int64_t most = std::int64_t{limits_.max_spindle} + limits_.max_beyond;
        if (spindle < least) return {kEncodersDisagree, 2, spindle, least, 0};
        if (spindle > most) return {kEncodersDisagree, 2, spindle, most, 0};
        return {};
    }

    static constexpr std::int32_t kFsrMax = 4095;

    ReferenceFields limits_ = widest<ReferenceFields>();
    PairLimits twist_limits_;    // motor and spindle, twisted by the proximal torque
    PairLimits stretch_limits_;  // jaw and spindle, by the distal torque
    Heat heat_;
    Heat load_heat_;
    std::int32_t load_ma_ = 0;
    Controller controller_;
    MotorGuard motor_;
    LoopGuard loop_;
    EncoderPair twist_;
    EncoderPair stretch_;
    Inputs last_;
    RestLimits rest_limits_;
    RestGuard rest_;
    ProbeLimits probe_limits_;
    EndProbe probe_;
    SensorGuard<3> sensors_{3, INT16_MIN, INT16_MAX};
    bool primed_ = false;
};

}  // namespace rig
