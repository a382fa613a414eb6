// Every guard of the reference profile at its limit: a reading at the limit never trips, one count beyond it
// trips, and exactly so many ticks after it began as the limits say.
#pragma once

#include <doctest/doctest.h>

#include "../core/profile_reference.hpp"

namespace guards {

using Profile = rig::ReferenceProfile;
using Inputs = Profile::Inputs;
using Limits = rig::ReferenceFields;

constexpr int kBegins = 30;  // tick at which a fault begins

struct Guard {
    rig::Trip code;
    std::uint8_t channel;
    int lasts;  // ticks of a fault until the trip, the first included
    void (*limit)(Limits&);
    // What the fault adds to readings of no size; `beyond` is 0 at the limit, 1 beyond. `since` counts from 0.
    void (*fault)(Inputs&, int since, int beyond);
};

inline const Guard kGuards[] = {
    {rig::kOverCurrent, 5, 1, [](Limits& l) { l.max_current = 100; },
     [](Inputs& i, int, int b) { i.current = -100 - b; }},
    {rig::kProximalTorque, 3, 1, [](Limits& l) { l.max_proximal = 100; },
     [](Inputs& i, int, int b) { i.proximal = 100 + b; }},
    {rig::kDistalTorque, 4, 1, [](Limits& l) { l.max_distal = 100; },
     [](Inputs& i, int, int b) { i.distal = -100 - b; }},
    {rig::kSpindleTravel, 1, 1, [](Limits& l) { l.min_spindle = -9; },
     [](Inputs& i, int, int b) { i.spindle = -9 - b; }},
    {rig::kSpindleTravel, 1, 1, [](Limits& l) { l.max_spindle = 9; },
     [](Inputs& i, int, int b) { i.spindle = 9 + b; }},
    {rig::kJawTravel, 2, 1, [](Limits& l) { l.min_jaw = -9; },
     [](Inputs& i, int, int b) { i.jaw = -9 - b; }},
    {rig::kJawTravel, 2, 1, [](Limits& l) { l.max_jaw = 9; },
     [](Inputs& i, int, int b) { i.jaw = 9 + b; }},
    {rig::kOverSpeed, 0, 3, [](Limits& l) { l.motor.max_motor_step = 10; },
     [](Inputs& i, int since, int b) { i.motor = (10 + b) * (since + 1); }},
    {rig::kStalled, 0, 20,
     [](Limits& l) {
         l.motor.stall_current = 51;
         l.choice.stall_ticks = 20;
     },
     [](Inputs& i, int since, int b) { i.current = since % 2 ? -50 - b : 50 + b; }},
    {rig::kSensorSaturated, 3, 5, [](Limits& l) { l.choice.saturated_ticks = 5; },
     [](Inputs& i, int, int b) { i.proximal = INT16_MAX - 1 + b; }},
    {rig::kSensorSaturated, 4, 5, [](Limits& l) { l.choice.saturated_ticks = 5; },
     [](Inputs& i, int, int b) { i.distal = INT16_MIN + 1 - b; }},
    {rig::kSensorStale, 4, 8, [](Limits& l) { l.choice.stale_ticks = 7; },
     [](Inputs& i, int since, int b) { i.distal = 50 + (b == 0 && since % 7 == 0); }},
    {rig::kEncoderJump, 0, 1, [](Limits& l) { l.loop.max_motor_jump = 60; },
     [](Inputs& i, int, int b) { i.motor = 60 + b; }},
    {rig::kEncoderJump, 1, 1, [](Limits& l) { l.max_spindle_jump = 60; },
     [](Inputs& i, int, int b) { i.spindle = -60 - b; }},
    {rig::kEncoderJump, 2, 1, [](Limits& l) { l.max_jaw_jump = 60; },
     [](Inputs& i, int, int b) { i.jaw = 60 + b; }},
    {rig::kEncodersDisagree, 0, 1,
     [](Limits& l) {
         l.motor_per_turn = -40;
         l.spindle_per_turn = 10;
         l.max_twist = 8;
     },
     [](Inputs& i, int, int b) { i.spindle = 2, i.motor = b; }},
    {rig::kEncodersDisagree, 0, 2,
     [](Limits& l) {
         l.motor_per_turn = -40;
         l.spindle_per_turn = 10;
         l.max_twist = 8;
     },
     [](Inputs& i, int since, int b) { i.motor = since % 2 ? 4 + b : -4; }},
    // jaw and spindle: a mean over 16 ms; half of the stretch is in doubt, and the jaw may be 30 ms late
    {rig::kEncodersDisagree, 2, 20,
     [](Limits& l) {
         l.jaw_per_turn = 20;
         l.spindle_per_turn = 10;
         l.stretch_e6 = 500000;
         l.max_stretch = 10;
     },
     [](Inputs& i, int, int b) { i.distal = 60, i.jaw = 30 + 15 + 10 + 11 * b; }},
    {rig::kEncodersDisagree, 2, 16,
     [](Limits& l) {
         l.jaw_per_turn = 10;
         l.spindle_per_turn = 10;
         l.stretch_e6 = 1000000;
         l.max_stretch = 10;
     },
     [](Inputs& i, int, int b) { i.distal = -10, i.jaw = -10 - 5 - 10 - 11 * b; }},
    {rig::kEncodersDisagree, 2, 15,
     [](Limits& l) {
         l.jaw_per_turn = 10;
         l.spindle_per_turn = 10;
         l.max_stretch = 0;
     },
     [](Inputs& i, int since, int b) { i.spindle = 16 + since, i.jaw = i.spindle + 30 + 20 * b; }},
    {rig::kEncodersDisagree, 2, 1,
     [](Limits& l) {
         l.jaw_per_turn = 20;
         l.spindle_per_turn = -10;
         l.stretch_e6 = 500000;
         l.jaw_zero = 7;
         l.max_spindle = 40;
         l.max_beyond = 8;
     },
     [](Inputs& i, int, int b) { i.distal = 60, i.jaw = 7 + 30 - 96 - 2 * b; }},
    {rig::kEncodersDisagree, 2, 1,
     [](Limits& l) {
         l.jaw_per_turn = 20;
         l.spindle_per_turn = -10;
         l.min_spindle = -40;
         l.max_beyond = 8;
     },
     [](Inputs& i, int, int b) { i.jaw = 96 + 2 * b; }},
    {rig::kEncoderFrozen, 0, 1,
     [](Limits& l) {
         l.torque_e3 = 1000;
         l.max_still_change = 20;
     },
     [](Inputs& i, int since, int b) { i.proximal = since == 0 ? 105 + 6 * b : since % 2; }},
    {rig::kEncoderFrozen, 0, 1,
     [](Limits& l) {
         l.torque_e3 = -1000;
         l.max_still_torque = 10;
     },
     [](Inputs& i, int since, int b) { i.current = since == 0 ? 100 + 5 * b : since % 2; }},
    // a motion of 8 counts is none
    {rig::kEncoderFrozen, 0, 6,
     [](Limits& l) {
         l.loop.frozen_motion = 8;
         l.loop.frozen_current = 20;
     },
     [](Inputs& i, int since, int b) { i.current = 30, i.motor = since % 2 * (9 - b); }},
    {rig::kFollowingError, 1, 7,
     [](Limits& l) {
         l.loop.max_following = 60;
         l.loop.following_ticks = 7;
     },
     [](Inputs& i, int, int b) { i.spindle = 60 + b; }},
    {rig::kOverheated, 5, 11,
     [](Limits& l) {
         l.motor.continuous_current = 10;
         l.motor.i2t = 3;
     },
     [](Inputs& i, int, int b) { i.current = b == 0 ? 10 : 20; }},
};

// Ticks until a motor that turned this way and then counts no more is found dead, its current rising as given.
inline int stands(int way, int rise) {  // its other encoders stand far from 0
    Profile::Settings settings = Profile::Settings::widest();
    settings.limits.torque_e3 = 1000;
    settings.limits.twist_e6 = 1;
    settings.limits.max_still_rise = 30;
    Profile profile;
    profile.begin(settings);
    for (int tick = 0; tick < 400; ++tick) {
        Inputs inputs;
        inputs.motor = 10 * way * (tick < 100 ? tick : 100);
        inputs.spindle = inputs.jaw = 5000 * way;
        inputs.current = tick < 100 ? 50 * way : 50 * way + rise;
        const rig::Crossing crossing = profile.check(inputs);
        if (crossing.code != rig::kNoTrip) return crossing.code == rig::kEncoderFrozen ? tick - 100 : -1;
    }
    return 0;
}

TEST_CASE("a current that rises the way the motor turned cannot leave it at rest, one that falls can") {
    for (int way : {1, -1}) {
        CHECK(stands(way, 33 * way) > 0);
        CHECK(stands(way, 31 * way) == 0);
        CHECK(stands(way, -90 * way) == 0);
    }
    CHECK(stands(0, 90) == 0);
}

// What a profile does whose spindle stands at 90 of 100 while the target is `target`: the tick of its first pull,
// the pull, and the tick of its trip; 0 for none. The motor answers each pull after `answers` ticks, or never.
struct Probed {
    int pulled = 0;
    int command = 0;
    int tripped = 0;
    int channel = -1;
};
inline Probed probe(int target, double kp, int answers) {
    Profile::Settings settings = Profile::Settings::widest();
    settings.gains = {kp, 0, 0, 0, 500};
    rig::ReferenceFields& limits = settings.limits;
    limits.min_spindle = -100, limits.max_spindle = 100;
    limits.probe_within = 8, limits.probe_patience = 5000;
    limits.torque_e3 = -1000, limits.loop.full_scale_current = 2000, limits.max_still_torque = 40;
    limits.loop.max_current_error = INT32_MAX;
    Profile profile;
    profile.begin(settings);
    Probed probed;
    Inputs inputs;
    inputs.spindle = 90;
    int pulls = 0;
    for (int tick = 1; tick < 1200; ++tick) {
        inputs.proximal = inputs.distal = inputs.current = tick % 2;
        const rig::Crossing crossing = profile.check(inputs);
        if (crossing.code == rig::kEncoderFrozen) {
            probed.channel = crossing.channel;
            probed.tripped = tick;
            break;
        }
        const int command = profile.drive({target, 0}, inputs).command_e4;
        pulls = command * kp * (target - 89.5) < 0 ? pulls + 1 : 0;
        if (pulls == 1 && probed.pulled == 0) probed = {tick, command, 0, -1};
        if (pulls > 0 && pulls == answers) inputs.motor += 2;
    }
    return probed;
}

TEST_CASE("encoders that do not count near an end are asked by a pull away from it, and trip when they are dead") {
    // 10 counts from the end, 2 more than `within`: 30 ticks and 10 more
    const Probed dead = probe(95, 1, 0);
    CHECK(dead.pulled == 41);
    CHECK(dead.command == -400);  // 2 x 40 of torque, 80 of current, of 2000
    CHECK(dead.tripped == 51);
    CHECK(dead.channel == 0);
    CHECK(probe(95, -1, 0).command == 400);
    const Probed at_target = probe(90, 1, 0);
    CHECK(at_target.pulled == 0);  // and no command either
    const Probed inward = probe(80, 1, 0);  // 190 counts from the other end
    CHECK(inward.pulled == 30 + 910 + 1);
    const Probed alive = probe(95, 1, 10);
    CHECK(alive.pulled == 41);
    CHECK(alive.tripped == 0);
    CHECK(probe(95, 1, 11).tripped == 51);
}

inline Inputs quiet(int tick) {
    Inputs inputs;
    inputs.proximal = inputs.distal = inputs.current = tick % 2;  // none of them stays
    return inputs;
}

TEST_CASE("a count that is missing is named by its channel") {
    for (int k = 0; k < 6; ++k) {
        Profile profile;
        profile.begin(Profile::Settings::widest());
        Inputs inputs;
        std::int32_t* const channels[6] = {&inputs.motor,    &inputs.spindle, &inputs.jaw,
                                           &inputs.proximal, &inputs.distal,  &inputs.current};
        *channels[k] = rig::kMissing;
        const rig::Crossing crossing = profile.check(inputs);
        CHECK(crossing.code == rig::kSensorMissing);
        CHECK(crossing.channel == k);
        CHECK(crossing.value == rig::kMissing);
        CHECK(crossing.limit == 0);
    }
}

TEST_CASE("the shortest time of a watch is a tick, and a safe state is one of two") {
    Profile::Settings settings = Profile::Settings::widest();
    rig::ChoiceFields& choice = settings.limits.choice;
    choice.watchdog_us = rig::kMaxWatchdogUs;
    choice.hold_command_e4 = 0;
    choice.seek = 0;
    for (int ticks : {0, 1}) {
        choice.stall_ticks = ticks;
        CHECK(settings.valid() == (ticks == 1));
    }
    for (int state : {0, 1, 2}) {
        choice.safe_state = state;
        CHECK(settings.valid() == (state < 2));
    }
}

// The tick at which a profile with these limits trips over these readings, or 0; and over what.
inline int trips(const Guard& guard, int beyond, rig::Crossing& crossing) {
    Profile::Settings settings = Profile::Settings::widest();
    guard.limit(settings.limits);
    Profile profile;
    profile.begin(settings);
    for (int tick = 1; tick < 200; ++tick) {
        Inputs inputs = quiet(tick);
        if (tick >= kBegins) guard.fault(inputs, tick - kBegins, beyond);
        inputs.motor += 1000;  // it may have begun anywhere
        profile.warm(inputs, 1);
        crossing = profile.check(inputs);
        if (crossing.code != rig::kNoTrip) return tick;
        profile.drive({0, 0}, inputs);
    }
    return 0;
}

TEST_CASE("a guard trips one count beyond its limit, after the time that the limits give, and not before") {
    for (const Guard& guard : kGuards) {
        CAPTURE(&guard - kGuards);
        rig::Crossing crossing;
        CHECK(trips(guard, 0, crossing) == 0);
        CHECK(trips(guard, 1, crossing) == kBegins + guard.lasts - 1);
        CHECK(crossing.code == guard.code);
        CHECK(crossing.channel == guard.channel);
        CHECK(crossing.late_us % Profile::kTickUs == 0);  // since a tick
    }
}

TEST_CASE("counts far from 0 at the first tick are no jump, and a stall is counted from that tick") {
    Profile::Settings settings = Profile::Settings::widest();
    Limits& limits = settings.limits;
    limits.loop.max_motor_jump = limits.max_spindle_jump = limits.max_jaw_jump = 60;
    limits.motor.stall_current = 50, limits.motor.stall_motion = 3, limits.choice.stall_ticks = 20;
    Profile profile;
    profile.begin(settings);
    Inputs inputs;
    inputs.motor = 5000, inputs.spindle = 1000, inputs.jaw = -900, inputs.current = 60;
    for (int tick = 1; tick < 20; ++tick) CHECK(profile.check(inputs).code == rig::kNoTrip);
    CHECK(profile.check(inputs).code == rig::kStalled);
}

TEST_CASE("a motor is frozen where its current changed since it last moved, wherever both began") {
    rig::LoopFields limits = rig::widest<Limits>().loop;
    limits.frozen_motion = 8, limits.frozen_current = 20;
    rig::LoopGuard guard;
    std::int32_t motor = 1000;
    guard.prime(motor, 500);
    const auto trips = [&](int ticks, int step, std::int32_t current) {
        rig::Crossing crossing;
        for (int k = 0; k < ticks && crossing.code == rig::kNoTrip; ++k) {
            crossing = guard.check(limits, 1000, 0, motor += step, current, {1, 0, 5});
        }
        return crossing.code == rig::kEncoderFrozen;
    };
    CHECK_FALSE(trips(50, 0, 500));
    CHECK_FALSE(trips(50, 9, 560));
    CHECK_FALSE(trips(50, 0, 560));
    CHECK(trips(50, 0, 530));
}

TEST_CASE("a current that stood before the first motion is no rise behind it") {
    Profile::Settings settings = Profile::Settings::widest();
    settings.limits.torque_e3 = 1000, settings.limits.twist_e6 = 1, settings.limits.max_still_rise = 30;
    Profile profile;
    profile.begin(settings);
    Inputs inputs;
    inputs.current = 100;
    for (int tick = 0; tick < 300; ++tick) {
        inputs.motor = 10 * (tick < 3 ? tick : 3);
        CHECK(profile.check(inputs).code == rig::kNoTrip);
    }
}

TEST_CASE("of a start whose heat is not known either motor may be too hot") {
    for (bool load : {false, true}) {
        Profile::Settings settings = Profile::Settings::widest();
        settings.limits.motor.continuous_current = settings.limits.continuous_load_ma = 10;
        (load ? settings.limits.load_i2t : settings.limits.motor.i2t) = 10;
        Profile profile;
        profile.assume_hot();
        CHECK(profile.too_hot(settings));
    }
}

TEST_CASE("a sensor at its end may stay there as long again while the rig holds") {
    Profile::Settings settings = Profile::Settings::widest();
    settings.limits.choice.saturated_ticks = 5;
    Profile profile;
    profile.begin(settings);
    Inputs inputs;
    inputs.proximal = INT16_MAX;
    for (int round = 0; round < 2; ++round) {
        for (int tick = 1; tick < 5; ++tick) CHECK(profile.check(inputs).code == rig::kNoTrip);
        CHECK(profile.check(inputs).code == rig::kSensorSaturated);
        profile.begin_to_hold(inputs);
    }
}

TEST_CASE("a sensor is saturated at its ends and not one count within") {
    const Profile profile;
    for (int count : {INT16_MIN, INT16_MIN + 1, INT16_MAX - 1, INT16_MAX}) {
        Inputs inputs;
        inputs.distal = count;
        CHECK(profile.saturated(inputs) == (count == INT16_MIN || count == INT16_MAX));
    }
}

TEST_CASE("a pull that begins with the first command lasts as long as any other") {
    const rig::ProbeLimits limits{-100, 100, 8, 5000, 400};
    rig::EndProbe probe;
    for (int still = 60; still < 70; ++still) {
        CHECK(probe.check(1000, still).code == rig::kNoTrip);
        CHECK(probe.drive(limits, 95, 90, still, 5) == -400);
    }
    CHECK(probe.check(1000, 70).code == rig::kEncoderFrozen);
}

TEST_CASE("an encoder that may be read late is believed to what the other turned in that time") {
    const rig::PairLimits limits{1, 1, 0, 0, 30, 1};
    for (int ahead : {7, 8}) {
        rig::EncoderPair pair;
        CHECK(pair.check(limits, 0, 0, 0, 2).code == rig::kNoTrip);
        // 8 counts in the newest of 16 ticks: 15 in 30 ticks
        CHECK((pair.check(limits, ahead, -8, 0, 2).code == rig::kNoTrip) == (ahead == 7));
    }
}

}  // namespace guards
