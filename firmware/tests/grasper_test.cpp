// The grasper's profile and its layer on a host, under the sanitizers. The guards of a whole board
// are tried by tests/drivers/test_grasper_board.py.
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "../boards/teensy/main.cpp"

namespace {

namespace wiring = rig::wiring;
using Profile = rig::GrasperProfile;

constexpr std::int32_t kTop = std::numeric_limits<std::int32_t>::max();

// Gains, and limits that nothing crosses.
Profile::Settings arming() {
    Profile::Settings settings = Profile::Settings::widest();
    for (rig::Gains& one : settings.gains) one = {2, 0, 0, 1, 5000};
    settings.choice.watchdog_us = 50000;
    settings.choice.hold_command_e4 = 0;
    REQUIRE(settings.valid());
    return settings;
}

Profile armed(const Profile::Settings& settings) {
    Profile profile;
    profile.begin(settings);
    return profile;
}

}  // namespace

TEST_CASE("every motor follows its own target by its own gains") {
    Profile::Settings settings = arming();
    settings.gains[1].kp = 3;
    Profile profile = armed(settings);
    Profile::Inputs inputs;
    const Profile::Outputs outputs = profile.drive({{10, 20, -3000}}, inputs);
    CHECK(outputs.in_force);
    CHECK(outputs.command_e4[0] == 20);
    CHECK(outputs.command_e4[1] == 60);
    CHECK(outputs.command_e4[2] == -5000);  // its limit
}

TEST_CASE("each motor has guards of its own, and the channel says whose was crossed") {
    for (std::size_t k = 0; k < Profile::kMotors; ++k) {
        Profile::Settings settings = arming();
        settings.axes[k].max_current = 100;
        Profile::Inputs inputs;
        for (std::int32_t& current : inputs.current) current = 101;
        rig::Crossing crossing = armed(settings).check(inputs);
        CHECK(crossing.code == rig::kOverCurrent);
        CHECK(crossing.channel == 3 + k);

        settings = arming();
        settings.axes[k].max_force = 500;
        inputs = Profile::Inputs();
        for (std::int32_t& force : inputs.force) force = 501;
        crossing = armed(settings).check(inputs);
        CHECK(crossing.code == rig::kOverForce);
        CHECK(crossing.channel == 6 + k);

        settings = arming();
        settings.axes[k].motor.max_motor_step = 9;
        Profile profile = armed(settings);
        inputs = Profile::Inputs();
        rig::Crossing fast;
        int ticks = 0;
        for (; ticks < 10 && fast.code == rig::kNoTrip; ++ticks) {
            fast = profile.check(inputs);
            for (std::int32_t& motor : inputs.motor) motor += 10;
        }
        CHECK(fast.code == rig::kOverSpeed);
        CHECK(fast.channel == k);
        CHECK(ticks == 4);
        CHECK(fast.late_us == 1000);
    }
}

TEST_CASE("nothing that is no number is valid") {
    for (double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e7}) {
        for (std::size_t k = 0; k < Profile::kMotors; ++k) {
            Profile::Settings wrong = arming();
            wrong.gains[k].kd = bad;
            CHECK_FALSE(wrong.valid());
        }
    }
    Profile::Settings wrong = arming();
    wrong.axes[2].min_motor = 5;
    wrong.axes[2].max_motor = 4;
    CHECK_FALSE(wrong.valid());
}

TEST_CASE("a setpoint beyond one motor's travel is refused") {
    Profile::Settings settings = arming();
    settings.axes[1].min_motor = -10;
    settings.axes[1].max_motor = 10;
    const Profile profile = armed(settings);
    CHECK(profile.allow({{kTop, 10, 0}}));
    CHECK_FALSE(profile.allow({{0, 11, 0}}));
    CHECK_FALSE(profile.allow({{0, -11, 0}}));
}

TEST_CASE("a board starts with all motors off, 0 A asked of each, and ticks at 2 kHz") {
    setup();
    for (std::size_t k = 0; k < Profile::kMotors; ++k) {
        CHECK(board.levels[wiring::kEnablePin[k]] == LOW);
        CHECK(board.duties[wiring::kSetPin[k]] == 410);
    }
    CHECK(timer.period_us == 500);
    REQUIRE((timer.function != nullptr));
    timer.function();
    CHECK(board.duties[wiring::kSetPin[2]] == 410);
}

TEST_CASE("what is wired to a motor is read with it, and one that is not ready tells no current") {
    rig::GrasperHardware grasper;
    grasper.begin();
    for (std::size_t k = 0; k < Profile::kMotors; ++k) {
        board.analog[wiring::kCurrentPin[k]] = static_cast<int>(2048 + 100 * k);
        board.analog[wiring::kForcePin[k]] = static_cast<int>(10 * k);
        board.levels[wiring::kReadyPin[k]] = LOW;
    }
    board.levels[wiring::kReadyPin[1]] = HIGH;
    Profile::Outputs outputs;
    outputs.in_force = true;
    outputs.command_e4[2] = 5000;
    for (std::uint32_t tick = 0; tick < wiring::kReadyAfterTicks; ++tick) grasper.drive(outputs);
    const Profile::Inputs inputs = grasper.sample();
    for (std::size_t k = 0; k < Profile::kMotors; ++k) {
        CHECK(inputs.motor[k] == static_cast<std::int32_t>(1000 * (k + 1)));
    }
    CHECK(inputs.force[2] == 20);
    CHECK(inputs.current[0] == 0);
    CHECK(inputs.current[1] == rig::kMissing);
    CHECK(inputs.current[2] == 196);
    CHECK(board.duties[wiring::kSetPin[2]] == wiring::kEscon.code(1.0));
    CHECK(board.levels[wiring::kEnablePin[0]] == HIGH);
}
