// The core on a host, under the sanitizers. Its guards and sessions are tried through the library by
// tests/drivers/test_guards.py and test_sessions.py too.
#ifndef RIG_MAIN_APART
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#endif
#include <doctest/doctest.h>

#include <limits>
#include <vector>

#include "../core/profile_grasper.hpp"
#include "../proofs/world.hpp"
#include "app_test.hpp"
#include "board_test.hpp"
#include "guards_test.hpp"

using proofs::Bytes;

TEST_CASE("published check values") {
    const std::uint8_t digits[] = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
    CHECK(rig::crc16(digits, 9) == 0x29B1);
    const std::uint8_t data[] = {0x11, 0x00, 0x00, 0x22, 0x33};
    std::uint8_t out[8];
    REQUIRE(rig::cobs_encode(data, 5, out) == 6);
    CHECK(Bytes(out, out + 6) == Bytes{0x02, 0x11, 0x01, 0x03, 0x22, 0x33});
    CHECK(rig::crc32("123456789") == 0xCBF43926U);
}

TEST_CASE("a string of 254 letters without a zero needs one byte more, as published") {
    std::uint8_t data[254], out[256];
    for (int k = 0; k < 254; ++k) data[k] = static_cast<std::uint8_t>(k + 1);
    REQUIRE(rig::cobs_encode(data, 254, out) == 255);
    CHECK(out[0] == 0xFF);
}

TEST_CASE("the longest frames in either direction arrive") {
    rig::FrameReceiver frames;
    const Bytes asked(rig::kMaxPayload, 7);
    int whole = 0;
    for (std::uint8_t byte : proofs::wire_of(asked)) whole += frames.take(byte);
    REQUIRE(whole == 1);
    CHECK(Bytes(frames.payload(), frames.payload() + frames.size()) == asked);
    const Bytes answered(rig::Frame::kMostPayload, 9);
    const rig::Frame frame(answered.data(), answered.size());
    for (std::size_t k = 0; k < frame.size; ++k) whole += frames.take(frame.bytes[k]);
    REQUIRE(whole == 2);
    CHECK(Bytes(frames.payload(), frames.payload() + frames.size()) == answered);
}

TEST_CASE("no gain that is not finite reaches a set-point") {
    rig::Gains gains{20, 0.1, 4, 0.3, 2700};
    CHECK(gains.valid());
    for (double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e7}) {
        rig::Gains wrong = gains;
        wrong.kd = bad;
        CHECK_FALSE(wrong.valid());
    }
}

TEST_CASE("the watchdog counts over the wrap of the clock") {
    rig::Watchdog watchdog;
    watchdog.heard();
    CHECK(watchdog.silent_us(0xFFFFFF00U) == 0);
    CHECK(watchdog.silent_us(0x00000100U) == 0x200);
}

TEST_CASE("heat is the current squared above the continuous one, at any rate") {
    for (std::int64_t tick_us : {1000, 500}) {
        rig::Heat heat;
        std::int64_t ticks = 0;
        // 30000 counts^2 above, so more than a tenth of a second of it is more than 3000 counts^2 s
        while (heat.check(3000, tick_us, 5).code == rig::kNoTrip) {
            heat.take(100, tick_us, 1, 200);
            ++ticks;
        }
        CHECK(ticks == 100000 / tick_us + 1);
    }
}

TEST_CASE("a motor of unknown heat may be armed once it has cooled by half of what is allowed") {
    for (int ticks : {4, 5}) {
        rig::Heat heat;
        heat.assume_hot();
        heat.take(10, 1000, ticks, 0);  // cools by 100 counts^2 in a tick, of 1000
        heat.settle(10, 1);
        CHECK(heat.too_hot(1) == (ticks == 4));
    }
}

TEST_CASE("heat is counted late from the first tick that warmed") {
    rig::Heat heat;
    heat.take(0, 1000, 5, 0);
    heat.take(0, 1000, 1, 1);
    const rig::Crossing crossing = heat.check(0, 1000, 5);
    CHECK(crossing.code == rig::kOverheated);
    CHECK(crossing.late_us == 1000);
}

TEST_CASE("a missing reading trips before anything is computed from it") {
    rig::ReferenceProfile reference;
    rig::ReferenceProfile::Inputs inputs;
    inputs.spindle = rig::kMissing;
    const rig::Crossing crossing = reference.check(inputs);
    CHECK(crossing.code == rig::kSensorMissing);
    CHECK(crossing.channel == 1);
}

TEST_CASE_TEMPLATE("any bytes do no harm", Profile, rig::ReferenceProfile, rig::GrasperProfile) {
    rig::Board<Profile, 4096> any("T");
    std::uint32_t random = 1;
    for (int round = 0; round < 200000; ++round) {
        random = random * 1664525U + 1013904223U;
        const auto byte = static_cast<std::uint8_t>(random >> 24 & (random & 1 ? 0xFF : 0x1F));
        any.template receive<rig::NoLock>(&byte, 1);
        if (round % 500 == 0) any.tick(static_cast<std::uint32_t>(round), {});
    }
}

TEST_CASE("a board that is built for one sign of the gain takes no other") {
    const rig::Gains toward{20, 0, 0, 0.3, 2700}, away{-20, 0, 0, 0.3, 2700}, own{1, 0, 0, 0, 3000}, any{0, 0, 0, 0, 3000};
    CHECK(toward.within(own));
    CHECK_FALSE(away.within(own));
    CHECK(away.within(any));
}

TEST_CASE("a rig without one of two encoders compares none with the other") {
    for (int lacking = 0; lacking < 3; ++lacking) {
        rig::ReferenceProfile::Settings settings = rig::ReferenceProfile::Settings::widest();
        rig::ReferenceFields& limits = settings.limits;
        limits.motor_per_turn = limits.spindle_per_turn = limits.jaw_per_turn = 10;
        (lacking == 0 ? limits.motor_per_turn : lacking == 1 ? limits.jaw_per_turn : limits.spindle_per_turn) = 0;
        limits.max_twist = limits.max_stretch = limits.max_beyond = 1;
        limits.min_spindle = -1000;
        limits.max_spindle = 1000;
        rig::ReferenceProfile profile;
        profile.begin(settings);
        rig::ReferenceProfile::Inputs inputs;
        CHECK(profile.check(inputs).code == rig::kNoTrip);
        (lacking == 0 ? inputs.motor : inputs.jaw) = 500;
        if (lacking == 2) inputs.motor = -500;
        for (int tick = 0; tick < 40; ++tick) CHECK(profile.check(inputs).code == rig::kNoTrip);
    }
}

TEST_CASE("a command number is new up to half the range ahead, and an old one never is") {
    rig::Session session;
    session.begin(1, 100);
    for (unsigned ahead : {1U, 2U, 0x7FFFU}) CHECK(session.is_new(static_cast<std::uint16_t>(100 + ahead)));
    for (unsigned ahead : {0U, 0x8000U, 0xFFFFU}) CHECK_FALSE(session.is_new(static_cast<std::uint16_t>(100 + ahead)));
}

TEST_CASE("a rig's settings are no wider than the board's in any limit, and equal where the board fixes one") {
    rig::ReferenceFields own = rig::widest<rig::ReferenceFields>();
    own.loop.max_motor_jump = 10;
    own.loop.full_scale_current = 2000;
    rig::ReferenceFields asked = own;
    CHECK(rig::within(asked, own));
    asked.loop.max_motor_jump = 11;
    CHECK_FALSE(rig::within(asked, own));
    asked = own;
    asked.loop.full_scale_current = 1999;
    CHECK_FALSE(rig::within(asked, own));
}

TEST_CASE("a controller that begins at a motor far from 0 does not take that for a speed") {
    rig::Controller controller;
    controller.reset({0, 0, 1, 1, 10000});
    CHECK(controller.tick(0, 0, 500) == 0);
    CHECK(controller.tick(0, 0, 507) == 7);
    controller.reset({0, 0, 8, 0.5, 10000});
    CHECK(controller.tick(0, 0, 500) == 0);
}

TEST_CASE("behind late ticks a command and an overspeed are those of the same speed on time") {
    rig::ReferenceProfile::Settings settings = rig::ReferenceProfile::Settings::widest();
    settings.gains = {0, 0, 1, 1, 10000};
    settings.limits.motor.max_motor_step = 6;
    rig::ReferenceProfile profile;
    profile.begin(settings);
    rig::ReferenceProfile::Inputs inputs;
    CHECK(profile.check(inputs).code == rig::kNoTrip);
    CHECK(profile.drive({0, 0}, inputs).command_e4 == 0);
    for (int tick = 1; tick <= 3; ++tick) {
        inputs.motor += 3 * 7;
        profile.late(inputs, 3);
        const rig::Crossing crossing = profile.check(inputs);
        CHECK(crossing.code == (tick < rig::kOverSpeedTicks ? rig::kNoTrip : rig::kOverSpeed));
        if (tick == rig::kOverSpeedTicks) CHECK(crossing.value == 7);
        CHECK(profile.drive({0, 0}, inputs).command_e4 == 7);
    }
}

TEST_CASE("a late tick is judged by its time: travel at the same speed is no jump, and more is") {
    for (int step : {10, 11}) {
        rig::ReferenceFields limits = rig::widest<rig::ReferenceFields>();
        limits.loop.max_motor_jump = limits.max_spindle_jump = limits.max_jaw_jump = 10;
        limits.motor.max_motor_step = 10;
        for (int channel = 0; channel < 3; ++channel) {
            rig::ReferenceProfile profile;
            rig::ReferenceProfile::Settings settings = rig::ReferenceProfile::Settings::widest();
            settings.limits = limits;
            profile.begin(settings);
            rig::ReferenceProfile::Inputs inputs;
            inputs.motor = inputs.spindle = inputs.jaw = 1000;
            CHECK(profile.check(inputs).code == rig::kNoTrip);
            rig::ReferenceProfile::encoder(inputs, static_cast<std::size_t>(channel)) += 5 * step;
            profile.late(inputs, 5);
            CHECK((profile.check(inputs).code == rig::kNoTrip) == (step == 10));
        }
    }
}
