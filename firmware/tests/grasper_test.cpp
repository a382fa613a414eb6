// The grasper's profile and its layer on a host, under the sanitizers. What fake and core answer alike is
// held by tests/drivers/test_grasper_twin.py; here is what is only in C++.
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

// The body of an arm command: gains, limits that nothing crosses, then what the test changes.
struct Arming {
    double gains[3][5] = {{2, 0, 0, 1, 5000}, {2, 0, 0, 1, 5000}, {2, 0, 0, 1, 5000}};
    std::int32_t limits[3][18] = {};
    std::int32_t choice[6] = {kTop, kTop, kTop, 50000, 0, 0};

    Arming() {
        for (auto& axis : limits) {
            for (std::int32_t& limit : axis) limit = kTop;
            axis[2] = -kTop - 1;
            axis[12] = axis[13] = 0;  // current and command are not compared
        }
    }

    bool reaches(Profile& profile) const {
        std::vector<std::uint8_t> body(Profile::kArmSize);
        std::uint8_t* at = body.data();
        std::memcpy(at, gains, sizeof gains);
        std::memcpy(at + sizeof gains, limits, sizeof limits);
        std::memcpy(at + sizeof gains + sizeof limits, choice, sizeof choice);
        rig::Reader reader(body.data());
        return profile.arm(reader);
    }
};

Profile armed(const Arming& arming) {
    Profile profile;
    REQUIRE(arming.reaches(profile));
    return profile;
}

}  // namespace

TEST_CASE("every motor follows its own target by its own gains") {
    Arming arming;
    arming.gains[1][0] = 3;
    Profile profile = armed(arming);
    Profile::Inputs inputs;
    const Profile::Outputs outputs = profile.drive({{10, 20, -3000}}, inputs);
    CHECK(outputs.in_force);
    CHECK(outputs.command_e4[0] == 20);
    CHECK(outputs.command_e4[1] == 60);
    CHECK(outputs.command_e4[2] == -5000);  // its limit
}

TEST_CASE("each motor has guards of its own, and the channel says whose was crossed") {
    for (std::size_t k = 0; k < Profile::kMotors; ++k) {
        Arming arming;
        arming.limits[k][0] = 100;  // current
        Profile::Inputs inputs;
        for (std::int32_t& current : inputs.current) current = 101;
        rig::Crossing crossing = armed(arming).check(inputs);
        CHECK(crossing.code == rig::kOverCurrent);
        CHECK(crossing.channel == 3 + k);

        arming = Arming();
        arming.limits[k][1] = 500;  // force
        inputs = Profile::Inputs();
        for (std::int32_t& force : inputs.force) force = 501;
        crossing = armed(arming).check(inputs);
        CHECK(crossing.code == rig::kOverForce);
        CHECK(crossing.channel == 6 + k);

        arming = Arming();
        arming.limits[k][4] = 9;  // speed
        Profile profile = armed(arming);
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

TEST_CASE("nothing that is no number arms it, and what was armed stays") {
    for (double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e7}) {
        for (std::size_t k = 0; k < Profile::kMotors; ++k) {
            Profile profile = armed(Arming());
            Arming wrong;
            wrong.gains[k][2] = bad;
            CHECK_FALSE(wrong.reaches(profile));
            CHECK(profile.choice().watchdog_us == 50000);
            CHECK(profile.drive({{10, 0, 0}}, {}).command_e4[0] == 20);
        }
    }
    Arming wrong;
    wrong.limits[2][2] = 5;
    wrong.limits[2][3] = 4;
    Profile profile;
    CHECK_FALSE(wrong.reaches(profile));
}

TEST_CASE("a setpoint beyond one motor's travel is refused") {
    Arming arming;
    arming.limits[1][2] = -10;
    arming.limits[1][3] = 10;
    const Profile profile = armed(arming);
    CHECK(profile.allow({{kTop, 10, 0}}));
    CHECK_FALSE(profile.allow({{0, 11, 0}}));
    CHECK_FALSE(profile.allow({{0, -11, 0}}));
}

TEST_CASE("a board starts with all motors off, 0 A asked of each, and ticks at 2 kHz") {
    setup();
    for (std::size_t k = 0; k < Profile::kMotors; ++k) {
        CHECK(board.levels[wiring::kEnablePin[k]] == LOW);
        CHECK(board.duties[wiring::kSetPin[k]] == 2048);
    }
    CHECK(timer.period_us == 500);
    REQUIRE((timer.function != nullptr));
    timer.function();
    CHECK(board.duties[wiring::kSetPin[2]] == 2048);
}

TEST_CASE("what is wired to a motor is read with it, and one that is not ready tells no current") {
    rig::GrasperHardware grasper;
    grasper.begin();
    for (std::size_t k = 0; k < Profile::kMotors; ++k) {
        board.analog[wiring::kCurrentPin[k]] = static_cast<int>(2048 + 100 * k);
        board.analog[wiring::kForcePin[k]] = static_cast<int>(10 * k);
        board.levels[wiring::kReadyPin[k]] = HIGH;
    }
    board.levels[wiring::kReadyPin[1]] = LOW;
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
