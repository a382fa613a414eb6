// A profile, a queue and a reference point of which next to nothing is known, for theorems on the board: what is
// shown with them holds for the reference rig and the grasper alike.
#pragma once

#include "../core/board.hpp"
#include "symbolic.hpp"

namespace proofs {

// Every guard, limit and controller may answer anything; a set point is allowed up to a bound.
struct AnyProfile {
    static constexpr std::int64_t kTickUs = 1000;
    static constexpr std::uint32_t kProtocolHash = 0;
    static constexpr std::size_t kArmSize = 4;
    static constexpr std::size_t kSetpointSize = 4;
    static constexpr std::size_t kMaxSetpoints = 2;

    struct Settings {
        std::int32_t bound = 0;
        bool seeking = false;
        static Settings widest() { return {}; }
        void read(rig::Reader& reader) { bound = reader.i32(); }
        bool valid() const { return bound >= 0; }
        bool seeks() const { return seeking; }
        bool within(const Settings& own) const { return bound <= own.bound; }
    };
    struct Inputs {
        std::int32_t counts[3] = {};
    };
    struct Setpoint {
        std::int32_t target = 0;
        static Setpoint read(rig::Reader& reader) { return {reader.i32()}; }
    };
    struct Outputs {
        std::int32_t command = 0;
        bool in_force = false;
    };

    static Setpoint resting(const Inputs&) { return {any<std::int32_t>()}; }
    static void write(rig::Writer&, const Inputs&, const Setpoint&, const Outputs&) {}
    void begin(const Settings& settings) { bound = settings.bound; }
    const rig::ChoiceFields& choice() const { return chosen; }
    void assume_hot() {}
    bool too_hot(const Settings&) { return any<bool>(); }
    void warm(const Inputs&, std::int64_t) {}
    void late(const Inputs&, std::int64_t) {}
    bool allow(const Setpoint& setpoint) const { return setpoint.target <= bound; }
    bool follows(const Setpoint&, const Setpoint&) const { return any<bool>(); }
    rig::Crossing leap(const Setpoint&, const Inputs&) const { return crossing(); }
    rig::Crossing check(const Inputs&) {
        const rig::Crossing found = crossing();
        crosses = found.code != rig::kNoTrip;
        return found;
    }
    Setpoint begin_to_hold(const Inputs&) { return {any<std::int32_t>()}; }
    Outputs drive(const Setpoint& setpoint, const Inputs&) { return {setpoint.target, true}; }
    bool saturated(const Inputs&) const { return any<bool>(); }

    std::int32_t bound = 0;
    bool crosses = false;
    rig::ChoiceFields chosen;

  private:
    static rig::Crossing crossing() {
        rig::Crossing found;
        const auto code = any<std::uint8_t>();
        assume(code <= rig::kEmergencyStop);
        found.code = static_cast<rig::Trip>(code);
        return found;
    }
};

}  // namespace proofs

namespace rig {

// Only its length is known: what it gives is any set point that it may have taken.
template <>
class SetpointQueue<proofs::AnyProfile::Setpoint, kQueueCapacity> {
  public:
    using Setpoint = proofs::AnyProfile::Setpoint;
    std::size_t free() const { return kQueueCapacity - used_; }
    bool empty() const { return used_ == 0; }
    void clear() { used_ = 0; }
    void push(const Setpoint* setpoints, std::size_t count) {
        claim(count <= free(), "no more set points are queued than fit");
        for (std::size_t k = 0; k < count; ++k) {
            claim(setpoints[k].target <= *bound_, "only allowed set points are queued");
        }
        used_ += count;
    }
    const Setpoint& oldest() const { return held_ = given(); }
    const Setpoint& newest() const { return held_ = given(); }
    Setpoint pop() {
        claim(used_ > 0, "nothing is taken from an empty queue");
        --used_;
        return given();
    }

    std::size_t used_ = 0;
    const std::int32_t* bound_ = nullptr;

  private:
    Setpoint given() const {
        const Setpoint found{any<std::int32_t>()};
        assume(found.target <= *bound_);
        return found;
    }
    mutable Setpoint held_;
};

// Where the zeros are does not matter here.
template <>
class ReferencePoint<proofs::AnyProfile> {
  public:
    void apply(proofs::AnyProfile::Inputs&) {}
    bool at_rest() const { return any<bool>(); }
    void set(const std::int32_t (&)[kEncoders]) {}
    bool set_at_index(const std::int32_t (&)[kEncoders]) { return any<bool>(); }
    void forget_index() {}
};

}  // namespace rig
