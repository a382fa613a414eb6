// The layer of the Teensy 3.5 on a host, under the sanitizers; what it shares with the 4.1's is tried in
// core_test.cpp.
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>

#include "../boards/teensy/main.cpp"

namespace {

namespace wiring = rig::wiring;

// One edge on a spindle line, and the interrupt it makes.
void set(int pin, int level) {
    board.levels[pin] = level;
    board.edges[pin]();
}

void turn(int counts) {
    static int phase = 0;
    constexpr int kA[4] = {0, 1, 1, 0}, kB[4] = {0, 0, 1, 1};
    for (int step = counts > 0 ? 1 : -1; counts != 0; counts -= step) {
        phase = (phase + step) & 3;
        const bool a_moves = board.levels[wiring::kSpindleA] != kA[phase];
        set(a_moves ? wiring::kSpindleA : wiring::kSpindleB, a_moves ? kA[phase] : kB[phase]);
    }
}

}  // namespace

TEST_CASE("it starts with both motors off, 0 A asked of both converters, and edges before samples") {
    board.levels[wiring::kSpindleA] = board.levels[wiring::kSpindleB] = LOW;
    setup();
    CHECK(board.levels[wiring::kDriveEnablePin] == LOW);
    CHECK(board.levels[wiring::kLoadEnablePin] == LOW);
    CHECK(board.duties[A21] == 0);
    CHECK(board.duties[A22] == 0);
    CHECK(board.priorities[IRQ_PORTC] < timer.level);
    const auto filtered = FTM_QDCTRL_QUADEN | FTM_QDCTRL_PHAFLTREN | FTM_QDCTRL_PHBFLTREN;
    CHECK(FTM1_QDCTRL == filtered);
    CHECK(FTM2_QDCTRL == filtered);
    CHECK(FTM1_FILTER == FTM2_FILTER);
    CHECK((FTM1_FILTER & 0xF) != 0);
    CHECK(FTM2_MOD == 0xFFFF);
}

TEST_CASE("only a tick that ended, behind a main loop that turned, feeds the chip's watchdog") {
    setup();
    CHECK(WDOG_TOVALL.value <= 20);
    CHECK(WDOG_TOVALH.value == 0);
    CHECK((WDOG_STCTRLH & (WDOG_STCTRLH_WDOGEN | WDOG_STCTRLH_ALLOWUPDATE)) == WDOG_STCTRLH_WDOGEN);
    timer.function();  // may find that the loop turned in another test
    const int begun = WDOG_REFRESH.writes;
    timer.function();
    CHECK(WDOG_REFRESH.writes == begun);  // the main loop has not turned
    loop();
    timer.function();
    const int meal = WDOG_REFRESH.writes - begun;
    CHECK(meal > 0);
    const int level = board.levels[rig::wiring::kAlivePin];
    timer.function();  // it hangs now
    timer.function();
    CHECK(WDOG_REFRESH.writes == begun + meal);
    CHECK(board.levels[rig::wiring::kAlivePin] == level);
    loop();
    loop();  // the tick hangs now
    CHECK(WDOG_REFRESH.writes == begun + meal);
    timer.function();
    CHECK(WDOG_REFRESH.writes == begun + 2 * meal);
    CHECK(board.levels[rig::wiring::kAlivePin] != level);
}

TEST_CASE("a 16-bit counter is followed over its ends, however often") {
    rig::WideCounter counter;
    std::int32_t expected = 0;
    std::uint16_t raw = 0;
    for (int step : {32767, 32767, 32767, -32768, -32768, -32768, -32768, 1, -1}) {
        raw = static_cast<std::uint16_t>(raw + step);
        expected += step;
        CHECK(counter.follow(raw) == expected);
    }
    rig::ReferenceHardware teensy;
    teensy.begin();
    FTM1_CNT = 0xFFFF;
    FTM2_CNT = 3;
    CHECK(teensy.sample().motor == -1);
    CHECK(teensy.sample().jaw == 3);
}

TEST_CASE("the spindle counts its edges both ways, and is missing for good once one was skipped") {
    rig::ReferenceHardware teensy;
    teensy.begin();
    const std::int32_t began = teensy.sample().spindle;
    turn(8192 + 3);
    CHECK(teensy.sample().spindle == began + 8195);
    turn(-10000);
    CHECK(teensy.sample().spindle == began - 1805);
    set(wiring::kSpindleA, board.levels[wiring::kSpindleA]);  // an interrupt without a change
    CHECK(teensy.sample().spindle == began - 1805);
    board.levels[wiring::kSpindleA] ^= 1;
    board.levels[wiring::kSpindleB] ^= 1;
    board.edges[wiring::kSpindleA]();
    CHECK(teensy.sample().spindle == rig::kMissing);
    turn(4);
    CHECK(teensy.sample().spindle == rig::kMissing);
}

TEST_CASE("no voltage goes beyond the limit of the current controller") {
    for (double current : {-1e9, -2.0, 0.0, 2.0, 1e9, std::nan("")}) {
        CHECK(wiring::kDrive.code(current) >= 0);
        CHECK(wiring::kDrive.code(current) <= 4095);
    }
    CHECK(wiring::kDrive.code(std::nan("")) == 0);
}
