// A small physics for the firmware process: motor and gearhead as one inertia with friction, a load
// torque at the jaw, sensors with noise. Not the rig's plant (rig/simulation has that): enough for
// the position loop to move something and for every sensor to live. Closing is positive.
#pragma once

#include <cmath>
#include <cstdint>

#include "../core/profile_reference.hpp"

namespace rig {

class PlainPlant {
  public:
    ReferenceProfile::Inputs sample() {
        ReferenceProfile::Inputs counts;
        counts.motor = whole(angle_ * kMotorCounts);
        counts.spindle = whole(-angle_ * kSpindleCounts);
        counts.jaw = whole(angle_ * kJawCounts);
        counts.proximal = whole(torque_ / kTorquePerCount) + noise(9);
        counts.distal = whole(-0.8 * torque_ / kTorquePerCount) + noise(9);
        counts.current = whole(1000 * current_) + noise(9);
        counts.fsr = whole(torque_ > 0 ? 2000 * torque_ : 0);
        return counts;
    }

    // Moves 1 ms.
    void step(const ReferenceProfile::Outputs& outputs) {
        current_ = -kFullScaleA * 1e-4 * outputs.command_e4;
        const double load = kLoadTorque * 1e-3 * outputs.load_ma;
        for (int part = 0; part < kParts; ++part) {
            const double friction = kCoulomb * std::tanh(speed_ / 0.02) + kViscous * speed_;
            speed_ += (kDriveTorque * current_ - friction - load) / kInertia * (1e-3 / kParts);
            angle_ += speed_ * (1e-3 / kParts);
        }
        torque_ = load + 0.3 * kCoulomb * std::tanh(speed_ / 0.02);
    }

  private:
    static constexpr double kTurn = 6.283185307179586;
    static constexpr double kMotorCounts = 4096 * 35 / kTurn;
    static constexpr double kSpindleCounts = 8192 / kTurn;
    static constexpr double kJawCounts = 4000 / kTurn;
    static constexpr double kTorquePerCount = 0.000039811;
    static constexpr double kFullScaleA = 2.06;
    static constexpr double kDriveTorque = 0.467;  // N m a A at the spindle
    static constexpr double kLoadTorque = 0.25;    // N m a A
    static constexpr double kInertia = 3.3e-4;     // kg m^2 at the spindle
    static constexpr double kViscous = 0.01;
    static constexpr double kCoulomb = 0.03;
    static constexpr int kParts = 20;

    static std::int32_t whole(double value) { return static_cast<std::int32_t>(std::floor(value)); }

    std::int32_t noise(std::int32_t width) {
        random_ = random_ * 1103515245U + 12345U;
        return static_cast<std::int32_t>((random_ >> 16) % static_cast<std::uint32_t>(width)) -
               width / 2;
    }

    double angle_ = -1366 / kSpindleCounts;
    double speed_ = 0;
    double current_ = 0;
    double torque_ = 0;
    std::uint32_t random_ = 1;
};

}  // namespace rig
