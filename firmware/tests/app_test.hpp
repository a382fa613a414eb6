// The bytes between a board and its hardware, and what a loop is held against: set values and set points that are
// not 0.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "../core/app.hpp"
#include "../proofs/world.hpp"

namespace app {

using Profile = rig::ReferenceProfile;

// Gives bytes in pieces and takes them in pieces, some of them none.
struct Narrow {
    struct Lock {
        Lock() {}  // a guard, not a value
    };
    std::vector<std::uint8_t> from_host, to_host;
    std::size_t piece = 7;
    int turns = 0, fed = 0;
    std::uint32_t clock = 0;
    Profile::Outputs outputs;

    std::uint32_t now_us() { return clock += 1000; }
    Profile::Inputs sample() { return {}; }
    void drive(const Profile::Outputs& given) { outputs = given; }
    void feed() { ++fed; }
    bool stopped() { return false; }
    std::size_t read(std::uint8_t* out, std::size_t room) {
        const std::size_t count = std::min({piece, room, from_host.size()});
        std::copy_n(from_host.begin(), count, out);
        from_host.erase(from_host.begin(), from_host.begin() + static_cast<std::ptrdiff_t>(count));
        return count;
    }
    std::size_t write(const std::uint8_t* bytes, std::size_t size) {
        const std::size_t count = ++turns % 3 == 0 ? 0 : std::min(piece, size);
        to_host.insert(to_host.end(), bytes, bytes + count);
        return count;
    }
};

TEST_CASE("a host that takes bytes slowly gets every frame whole and in order") {
    Narrow hardware;
    rig::App<Profile, Narrow, 4096> app(hardware, "SLOW");
    app.begin(3, Profile::Settings::widest(), true);
    constexpr int kFrames = 40;  // more than one filling of the buffer
    for (std::uint16_t number = 0; number < kFrames; ++number) {
        const proofs::Bytes wire = proofs::wire_of(proofs::World::header(rig::kHello, number));
        hardware.from_host.insert(hardware.from_host.end(), wire.begin(), wire.end());
    }
    for (int turn = 0; turn < 5000; ++turn) app.exchange();
    CHECK(hardware.from_host.empty());
    rig::FrameReceiver frames;
    int whole = 0;
    for (std::uint8_t byte : hardware.to_host) {
        if (!frames.take(byte)) continue;
        CHECK(frames.payload()[1] == rig::kHelloReply);
        CHECK(frames.payload()[2] == whole);
        ++whole;
    }
    CHECK(whole == kFrames);
}

// Takes every byte at once; a tick may come whenever the board is not locked.
struct Interrupted : Narrow {
    static inline std::function<void()> between;
    struct Lock {
        Lock() {}
        ~Lock() {
            if (between) between();
        }
    };
    std::size_t write(const std::uint8_t* bytes, std::size_t size) {
        to_host.insert(to_host.end(), bytes, bytes + size);
        return size;
    }
};

TEST_CASE("samples that are logged while bytes are copied out reach the host whole and in order") {
    for (int waiting = 0; waiting < 30; ++waiting) {
        Interrupted hardware;
        hardware.piece = 512;
        rig::App<Profile, Interrupted, 4096> app(hardware, "TICKS");
        app.begin(1, Profile::Settings::widest(), true);
        hardware.from_host = proofs::wire_of(proofs::World::header(rig::kStart, 1));
        app.exchange();
        for (int tick = 0; tick < waiting; ++tick) app.tick();
        int more = 12;
        Interrupted::between = [&] {
            if (--more > 0) app.tick();
        };
        for (int turn = 0; turn < 10; ++turn) app.exchange();
        Interrupted::between = nullptr;
        rig::FrameReceiver frames;
        std::uint32_t next = 0;
        for (std::uint8_t byte : hardware.to_host) {
            if (!frames.take(byte) || frames.payload()[1] != rig::kSample) continue;
            CHECK(rig::Reader(frames.payload() + 4).u32() == next);
            ++next;
        }
        CHECK(next == static_cast<std::uint32_t>(waiting + 11));
    }
}

TEST_CASE("a board takes its rig for a real one unless it was declared simulated") {
    for (bool simulated : {false, true}) {
        Narrow hardware;
        rig::App<Profile, Narrow, 4096> app(hardware, "REAL");
        simulated ? app.begin(1, Profile::Settings::widest(), true) : app.begin(1, Profile::Settings::widest());
        hardware.from_host = proofs::wire_of(proofs::World::header(rig::kHello, 1));
        for (int turn = 0; turn < 60; ++turn) app.exchange();
        rig::FrameReceiver frames;
        int whole = 0;
        for (std::uint8_t byte : hardware.to_host) whole += frames.take(byte);
        REQUIRE(whole == 1);
        CHECK(rig::Reader(frames.payload() + frames.size() - 6).u16() == (simulated ? rig::kReferenced : 0));
    }
}

TEST_CASE("a board that was asked nothing sends nothing") {
    Narrow hardware;
    rig::App<Profile, Narrow, 4096> app(hardware, "MUTE");
    app.begin(1, Profile::Settings::widest(), true);
    for (int turn = 0; turn < 4; ++turn) app.exchange();
    CHECK(hardware.to_host.empty());
}

TEST_CASE("the chip's watchdog is fed once by each tick that the main loop turned before") {
    Narrow hardware;
    rig::App<Profile, Narrow, 4096> app(hardware, "FED");
    app.begin(1, Profile::Settings::widest(), true);
    app.tick();
    CHECK(hardware.fed == 0);
    app.exchange();
    app.tick();
    app.tick();
    CHECK(hardware.fed == 1);
}

// The code that a profile finds with a constant target, command and reading of the spindle and the current.
inline rig::Trip found(std::int32_t target, std::int32_t spindle, std::int32_t current) {
    Profile::Settings settings = Profile::Settings::widest();
    settings.gains = {1, 0, 0, 1, 5000};
    settings.limits.loop.max_following = 60;
    settings.limits.loop.following_ticks = 3;
    settings.limits.loop.full_scale_current = -2000;
    settings.limits.loop.current_offset = 30;
    settings.limits.loop.max_current_error = 20;
    settings.limits.loop.current_ticks = 1;
    Profile profile;
    profile.begin(settings);
    for (int tick = 0; tick < 200; ++tick) {
        Profile::Inputs inputs;
        inputs.spindle = spindle;
        inputs.current = current;
        const rig::Crossing crossing = profile.check(inputs);
        if (crossing.code != rig::kNoTrip) return crossing.code;
        profile.drive({target, 0}, inputs);
    }
    return rig::kNoTrip;
}

TEST_CASE("following error and current are held against the target and the command, with their signs") {
    // a command of 50 ten-thousandths asks for -10 counts of current, beside the offset of 30
    CHECK(found(1000, 950, 20) == rig::kNoTrip);
    CHECK(found(-1000, -1060, 18) == rig::kNoTrip);
    CHECK(found(1000, 939, 18) == rig::kFollowingError);
    CHECK(found(1000, 1061, 42) == rig::kFollowingError);
    CHECK(found(1000, 950, 41) == rig::kCurrentMismatch);
    CHECK(found(1000, 950, -1) == rig::kCurrentMismatch);
    CHECK(found(1000, 1050, 61) == rig::kCurrentMismatch);
    CHECK(found(1000, 1050, 60) == rig::kNoTrip);
}

TEST_CASE("a hold is gentle, where the spindle stood, and ends after its time") {
    Profile::Settings settings = Profile::Settings::widest();
    settings.gains = {10, 0, 0, 1, 5000};
    settings.limits.choice.hold_command_e4 = 300;
    Profile profile;
    profile.begin(settings);
    Profile::Inputs inputs;
    inputs.spindle = 500;
    profile.check(inputs);
    const Profile::Outputs outputs = profile.drive({1000, 7}, inputs);
    CHECK(outputs.command_e4 == 5000);
    CHECK(outputs.load_ma == 7);
    CHECK(outputs.in_force);
    const Profile::Setpoint held = profile.begin_to_hold(inputs);
    CHECK(held.target == 500);
    CHECK(held.load_ma == 0);
    inputs.spindle = 400;
    CHECK(profile.drive(held, inputs).command_e4 == 300);
}

TEST_CASE("what a board was armed with last, its motors' heat apart, is forgotten at the next arming") {
    Profile::Settings settings = Profile::Settings::widest();
    settings.limits.load_i2t = 10;
    settings.limits.continuous_load_ma = 10;
    Profile profile;
    profile.begin(settings);
    Profile::Inputs inputs;
    for (int tick = 0; tick < 40; ++tick) {
        profile.warm(inputs, 1);
        profile.drive({0, 20}, inputs);
    }
    profile.begin(settings);  // 300 counts^2 for 39 ms is more than half of what is allowed
    CHECK(profile.too_hot(settings));
    for (int tick = 0; tick < 80; ++tick) profile.warm(inputs, 1);
    CHECK_FALSE(profile.too_hot(settings));
    profile.assume_hot();
    CHECK(profile.too_hot(settings));
}

}  // namespace app
