// A small physics for the firmware process of the grasper: three motors behind gearheads with friction,
// each against a spring beyond a first contact. Not the simulated grasper (rig/simulation has that).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "../core/profile_grasper.hpp"

namespace rig {

class PlainGrasper {
  public:
    GrasperProfile::Inputs sample() {
        GrasperProfile::Inputs counts;
        for (std::size_t k = 0; k < GrasperProfile::kMotors; ++k) {
            const Axis& axis = axes_[k];
            counts.motor[k] = whole(axis.angle * kMotorCounts);
            counts.current[k] = whole(1e3 * axis.current) + noise(9);
            counts.force[k] = kForceZero + whole(contact(axis) / kForceArm / kNewtonACount) + noise(9);
        }
        return counts;
    }

    // Moves one tick.
    void step(const GrasperProfile::Outputs& outputs) {
        constexpr double kStep = 1e-6 * GrasperProfile::kTickUs / kParts;
        for (std::size_t k = 0; k < GrasperProfile::kMotors; ++k) {
            Axis& axis = axes_[k];
            axis.current = kFullScaleA * 1e-4 * outputs.command_e4[k];
            for (int part = 0; part < kParts; ++part) {
                const double friction = kCoulomb * std::tanh(axis.speed / 0.02) + kViscous * axis.speed;
                axis.speed += (kTorque * axis.current - friction - contact(axis)) / kInertia * kStep;
                axis.angle += axis.speed * kStep;
            }
        }
    }

  private:
    struct Axis {
        double angle = 0;
        double speed = 0;
        double current = 0;
    };

    static constexpr double kRatio = 66;
    static constexpr double kMotorCounts = 2048 * kRatio / 6.283185307179586;
    static constexpr double kFullScaleA = 2.0;
    static constexpr double kTorque = kRatio * 14.6e-3;           // N m a A at the joint
    static constexpr double kInertia = kRatio * kRatio * 2.7e-7;  // kg m^2 at the joint
    static constexpr double kCoulomb = 4e-3;
    static constexpr double kViscous = 2e-2;
    static constexpr double kContact = 0.1;    // rad
    static constexpr double kStiffness = 0.3;  // N m a rad
    static constexpr double kForceArm = 0.010;
    static constexpr double kNewtonACount = 4.4 / 4095;
    static constexpr std::int32_t kForceZero = 100;
    static constexpr int kParts = 10;

    static double contact(const Axis& axis) {
        return axis.angle > kContact ? kStiffness * (axis.angle - kContact) : 0;
    }
    static std::int32_t whole(double value) { return static_cast<std::int32_t>(std::floor(value)); }

    std::int32_t noise(std::int32_t width) {
        random_ = random_ * 1103515245U + 12345U;
        return static_cast<std::int32_t>((random_ >> 16) % static_cast<std::uint32_t>(width)) -
               width / 2;
    }

    Axis axes_[GrasperProfile::kMotors];
    std::uint32_t random_ = 1;
};

}  // namespace rig
