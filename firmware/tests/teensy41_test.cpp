// The Teensy 4.1's layer on a host, under the sanitizers, against tests/arduino.
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>

#include "../boards/teensy/main.cpp"
#include "../proofs/world.hpp"

TEST_CASE("a Teensy starts with both motors off and 0 A asked for") {
    setup();
    CHECK(board.levels[rig::wiring::kDriveEnablePin] == LOW);
    CHECK(board.levels[rig::wiring::kLoadEnablePin] == LOW);
    CHECK(board.duties[rig::wiring::kDriveSetPin] == 410);
    REQUIRE((timer.function != nullptr));
    timer.function();
    CHECK(board.duties[rig::wiring::kDriveSetPin] == 410);
}

TEST_CASE("a Teensy answers a hello, with interrupts off only while it touches the board") {
    setup();
    for (std::uint8_t byte : proofs::wire_of({rig::kVersion, rig::kHello, 1, 0})) Serial.in.push_back(byte);
    loop();
    loop();
    CHECK(board.locked == 0);
    CHECK(Serial.out.size() > rig::kSerialSize);
    Serial.out.clear();
    Serial.room = 5;  // a host that does not read
    for (std::uint8_t byte : proofs::wire_of({rig::kVersion, rig::kHello, 2, 0})) Serial.in.push_back(byte);
    loop();
    CHECK(Serial.out.size() == 5);
    Serial.room = 512;
    loop();
    CHECK(Serial.out.size() > rig::kSerialSize);
}

TEST_CASE("only a tick that ended, behind a main loop that turned, feeds the chip's watchdog") {
    setup();
    CHECK(WDOG3_TOVAL.value <= 20 * 33);
    CHECK((WDOG3_CS & (WDOG_CS_EN | WDOG_CS_UPDATE)) == WDOG_CS_EN);
    timer.function();  // may find that the loop turned in another test
    const int begun = WDOG3_CNT.writes;
    timer.function();
    CHECK(WDOG3_CNT.writes == begun);  // the main loop has not turned
    loop();
    timer.function();
    const int meal = WDOG3_CNT.writes - begun;
    CHECK(meal > 0);
    const int level = board.levels[rig::wiring::kAlivePin];
    timer.function();  // it hangs now
    timer.function();
    CHECK(WDOG3_CNT.writes == begun + meal);
    CHECK(board.levels[rig::wiring::kAlivePin] == level);
    loop();
    loop();  // the tick hangs now
    CHECK(WDOG3_CNT.writes == begun + meal);
    timer.function();
    CHECK(WDOG3_CNT.writes == begun + 2 * meal);
    CHECK(board.levels[rig::wiring::kAlivePin] != level);
}

TEST_CASE("a Teensy whose timer does not start leaves its motors off and its watchdog hungry") {
    board.levels[rig::wiring::kDriveEnablePin] = HIGH;
    timer.works = false;
    setup();
    timer.works = true;
    CHECK(board.levels[rig::wiring::kDriveEnablePin] == LOW);
    const int begun = WDOG3_CNT.writes;
    for (int turns = 0; turns < 100; ++turns) loop();
    CHECK(WDOG3_CNT.writes == begun);
}

TEST_CASE("a USB line that was gone for a moment is written to again") {
    setup();
    Serial.out.clear();
    Serial.detached = true;
    for (std::uint8_t byte : proofs::wire_of({rig::kVersion, rig::kHello, 1, 0})) Serial.in.push_back(byte);
    for (int turns = 0; turns < 10; ++turns) loop();
    CHECK(Serial.out.empty());
    Serial.detached = false;
    for (int turns = 0; turns < 10; ++turns) loop();
    CHECK(Serial.out.size() > rig::kSerialSize);
}

TEST_CASE("an enabled controller that is not ready reports no current") {
    rig::ReferenceHardware teensy;
    teensy.begin();
    board.analog[rig::wiring::kDriveCurrentPin] = 2048;
    board.levels[rig::wiring::kDriveReadyPin] = HIGH;  // a broken wire, or no power
    board.levels[rig::wiring::kLoadReadyPin] = LOW;
    CHECK(teensy.sample().current != rig::kMissing);
    rig::ReferenceProfile::Outputs outputs;
    outputs.in_force = true;
    for (std::uint32_t tick = 0; tick < rig::wiring::kReadyAfterTicks; ++tick) teensy.drive(outputs);
    CHECK(board.levels[rig::wiring::kDriveEnablePin] == HIGH);
    CHECK(teensy.sample().current == rig::kMissing);
    board.levels[rig::wiring::kDriveReadyPin] = LOW;
    CHECK(teensy.sample().current != rig::kMissing);
    board.levels[rig::wiring::kLoadReadyPin] = HIGH;
    CHECK(teensy.sample().current == rig::kMissing);
}

TEST_CASE("a current is asked for by its size, and its sign by a line of its own") {
    rig::ReferenceHardware teensy;
    teensy.begin();
    rig::ReferenceProfile::Outputs outputs;
    outputs.in_force = true;
    outputs.command_e4 = -5000;
    outputs.load_ma = 500;
    teensy.drive(outputs);
    CHECK(board.duties[rig::wiring::kDriveSetPin] == rig::wiring::kDrive.code(1.0));
    CHECK(board.duties[rig::wiring::kDriveSetPin] > board.duties[rig::wiring::kLoadSetPin]);
    CHECK(board.levels[rig::wiring::kDriveDirectionPin] == LOW);
    CHECK(board.levels[rig::wiring::kLoadDirectionPin] == HIGH);
    CHECK(rig::wiring::kDrive.set_value.input(0.0) == doctest::Approx(0.1));  // and less is not more current
}

TEST_CASE("an emergency stop is pressed while its contact, or its wire, is open") {
    rig::ReferenceHardware teensy;
    teensy.begin();
    board.levels.erase(rig::wiring::kStopPin);  // open: the pull-up's level
    CHECK(teensy.stopped());
    board.levels[rig::wiring::kStopPin] = LOW;
    CHECK_FALSE(teensy.stopped());
}

TEST_CASE("a current converter at its ends is a saturated field") {
    CHECK(rig::wiring::kDrive.milliampere(0) == INT16_MIN);
    CHECK(rig::wiring::kDrive.milliampere(4095) == INT16_MAX);
}

TEST_CASE("two boards with the same image have serial numbers of their own") {
    CHECK(std::strncmp(rig::TeensyLink::serial("NAME"), "NAME-0000444C", 24) == 0);
}

TEST_CASE("the settings that a board is built with are valid, and a host may ask for no more") {
    rig::ReferenceProfile::Settings own = rig::wiring::own_limits();
    own.limits.choice.watchdog_us = 50000;
    CHECK(own.valid());
    rig::ReferenceProfile::Settings asked = own;
    CHECK(asked.within(rig::wiring::own_limits()));
    ++asked.limits.max_current;
    CHECK_FALSE(asked.within(rig::wiring::own_limits()));
}

TEST_CASE("each encoder of a Teensy 4.1 has inputs of the crossbar for itself") {
    rig::ReferenceHardware teensy;
    teensy.begin();
    CHECK(teensy.sample().motor == 1000);
    CHECK(teensy.sample().spindle == 2000);
    CHECK(teensy.sample().jaw == 3000);
}

TEST_CASE("the index of the spindle is in one sample, and a disturbance of its line is in none") {
    rig::ReferenceHardware teensy;
    teensy.begin();
    board.levels[rig::wiring::kSpindleIndex] = LOW;
    board.edges[rig::wiring::kSpindleIndex]();
    CHECK_FALSE(teensy.sample().indexed);
    board.levels[rig::wiring::kSpindleIndex] = HIGH;
    board.edges[rig::wiring::kSpindleIndex]();
    CHECK(teensy.sample().indexed);
    CHECK_FALSE(teensy.sample().indexed);
}

TEST_CASE("a torque converter at its ends is a saturated field") {
    rig::ReferenceHardware teensy;
    teensy.begin();
    board.analog[rig::wiring::kProximalPin] = 4095;
    board.analog[rig::wiring::kDistalPin] = 0;
    CHECK(teensy.sample().proximal == INT16_MAX);
    CHECK(teensy.sample().distal == INT16_MIN);
}

TEST_CASE_TEMPLATE("cells whose converter is not there are missing", Cells, rig::wiring::AdsPins, rig::wiring::HxPins) {
    Cells cells;
    board.levels.clear();
    cells.begin();
    const rig::Torques torques = cells.sample();
    CHECK(torques.proximal == rig::kMissing);
    CHECK(torques.distal == rig::kMissing);
}

TEST_CASE("each HX711 is read at pins of its own") {
    rig::wiring::HxPins cells;
    cells.begin();
    board.levels[12] = LOW;  // the proximal cell's: a conversion is ready, and all its bits are 0
    const rig::Torques torques = cells.sample();
    CHECK(torques.proximal == 0);
    CHECK(torques.distal == rig::kMissing);
}

TEST_CASE("no command goes beyond the limit of the current controller") {
    const rig::EsconWiring& wiring = rig::wiring::kDrive;
    for (double current : {-1e9, -2.0, 0.0, 2.0, 1e9, std::nan("")}) {
        CHECK(wiring.code(current) >= 409);
        CHECK(wiring.code(current) <= 3686);
    }
    CHECK(wiring.code(std::nan("")) == wiring.code(0.0));
}
