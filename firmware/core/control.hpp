// The position controller, the twin of drivers/teensy/control.py: the same float64 operations in the
// same order (build with -ffp-contract=off), so that board and fake answer with the same bytes.
#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>

#include "protocol.hpp"

namespace rig {

constexpr double kMaxGain = 1e6;
constexpr double kFullScaleE4 = 10000;

// Gains in command ticks (1e-4 of full scale) a spindle count, a spindle count and tick, and a motor
// count and tick; the weight of the newest velocity; the limit in command ticks.
struct Gains {
    double kp = 0;
    double ki = 0;
    double kd = 0;
    double velocity_filter = 0;
    double limit = 0;

    void read(Reader& reader) {
        for (double* gain : {&kp, &ki, &kd, &velocity_filter, &limit}) *gain = reader.f64();
    }

    // Whether the largest command is no larger than the board's own, and drives towards the target as its does: a
    // board whose kp is 0 takes either sign.
    bool within(const Gains& own) const { return limit <= own.limit && kp * own.kp >= 0; }

    // False for NaN too: no such number ever reaches a set-point.
    bool valid() const {
        for (double gain : {kp, ki, kd, velocity_filter, limit}) {
            if (!(std::fabs(gain) <= kMaxGain)) return false;
        }
        return 0 <= velocity_filter && velocity_filter <= 1 && 0 <= limit && limit <= kFullScaleE4;
    }
};

class Controller {
  public:
    void reset(const Gains& gains) {
        *this = Controller();
        gains_ = gains;
    }

    // From now on no command is larger, to hold rather than to follow.
    void limit_to(double command) {
        if (command < gains_.limit) gains_.limit = command;
    }

    // See MotorGuard::late.
    void late(std::int32_t motor, std::int64_t ticks) {
        previous_motor_ = motor - (motor - previous_motor_) / static_cast<double>(ticks);
    }

    // One tick; returns the command in ticks of 1e-4 of full scale.
    std::int32_t tick(std::int32_t target, std::int32_t spindle, std::int32_t motor) {
        if (!primed_) {
            previous_motor_ = motor;
            primed_ = true;
        }
        const double velocity = motor - previous_motor_;
        previous_motor_ = motor;
        motor_velocity_ += gains_.velocity_filter * (velocity - motor_velocity_);
        const auto error = static_cast<double>(std::int64_t{target} - spindle);
        integral_ = within_limit(integral_ + gains_.ki * error);
        const double command = gains_.kp * error + integral_ + gains_.kd * motor_velocity_;
        return static_cast<std::int32_t>(std::floor(within_limit(command) + 0.5));
    }

  private:
    double within_limit(double value) const {
        if (value < -gains_.limit) return -gains_.limit;
        return value > gains_.limit ? gains_.limit : value;
    }

    Gains gains_;
    double integral_ = 0;
    double previous_motor_ = 0;
    double motor_velocity_ = 0;
    bool primed_ = false;
};

}  // namespace rig
