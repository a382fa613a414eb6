// What a board answers, logs and does, command by command and tick by tick.
#pragma once

#include <doctest/doctest.h>

#include "desk.hpp"

namespace board {

using desk::Bytes;
using desk::Desk;
using desk::widest;
using desk::word;

TEST_CASE("a queue that ran dry trips after its time, pings or not, and its report names when") {
    rig::ReferenceFields limits = widest();
    limits.choice.dry_ticks = 10;
    Desk desk(limits);
    desk.arm();
    REQUIRE(desk.result() == rig::kOk);
    desk.run(20);  // nothing was queued yet: that is not dry
    CHECK(desk.board.in_force());
    desk.setpoints({0, 0, 0});
    desk.run(3 + 10);
    desk.ping();
    CHECK(desk.board.in_force());
    desk.run(1);
    CHECK_FALSE(desk.board.in_force());
    CHECK(desk.board.trip() == rig::kQueueRanDry);
    desk.run(7);
    desk.send(rig::kTrip, {});
    CHECK(desk.answer[1] == rig::kTripReport);
    CHECK(desk.answer[4] == rig::kQueueRanDry);
    CHECK(word(desk.answer, 14) == 34000);
    desk.send(rig::kClear, {rig::kQueueRanDry});
    CHECK(desk.result() == rig::kOk);
    desk.send(rig::kTrip, {});
    CHECK(desk.answer[4] == rig::kNoTrip);
    CHECK(word(desk.answer, 14) == 0);
}

TEST_CASE("samples are numbered from each start on, and a stopped board sends none") {
    Desk desk(widest());
    for (int round = 0; round < 2; ++round) {
        desk.run(5);
        CHECK(word(desk.sample, 4) == 4);
        desk.send(rig::kStop, {});
        desk.samples = 0;
        desk.run(3);
        CHECK(desk.samples == 0);
        desk.send(rig::kStart, {});
    }
}

TEST_CASE("the place of the index gives the reference once, and not after a failed check of an encoder") {
    rig::ReferenceFields limits = widest();
    limits.max_spindle_jump = 50;
    Desk desk(limits);
    Bytes counts;
    for (std::uint32_t count : {70U, 80U, 90U}) proofs::put(counts, count, 4);
    counts.push_back(1);
    const auto pass_index = [&desk] {
        desk.inputs.indexed = true;
        desk.run(1);
        desk.inputs.indexed = false;
        desk.inputs.jaw += 3;  // where it stands then is another place
        desk.run(150);
    };
    desk.inputs.motor = 700;
    pass_index();
    CHECK(word(desk.sample, 12) == 700);  // the index alone moves no zero
    desk.send(rig::kReference, counts);
    CHECK(desk.result() == rig::kOk);
    desk.run(1);
    rig::Reader reader(desk.sample.data() + 12);
    for (std::uint32_t count : {70U, 80U, 93U}) CHECK(reader.u32() == count);
    desk.send(rig::kReference, counts);
    CHECK(desk.result() == rig::kNoIndex);
    pass_index();
    desk.arm();
    desk.ping();
    desk.run(2);
    desk.inputs.spindle += 51;
    desk.run(1);
    CHECK(desk.board.trip() == rig::kEncoderJump);
    desk.run(150);
    desk.send(rig::kReference, counts);
    CHECK(desk.result() == rig::kNoIndex);
}

TEST_CASE("a missing encoder is no rest, and a reference gives the next samples their counts") {
    Desk desk(widest());
    desk.run(150);
    desk.inputs.spindle = rig::kMissing;
    desk.run(1);
    desk.inputs.spindle = 0;
    desk.run(1);
    Bytes counts;
    for (std::uint32_t count : {70U, 80U, 90U}) proofs::put(counts, count, 4);
    counts.push_back(0);  // of the present place
    desk.send(rig::kReference, counts);
    CHECK(desk.result() == rig::kNotAtRest);
    desk.run(150);
    desk.send(rig::kReference, counts);
    CHECK(desk.result() == rig::kOk);
    desk.inputs.proximal = 5;
    desk.inputs.distal = -6;
    desk.run(1);
    rig::Reader reader(desk.sample.data() + 12);
    for (std::uint32_t count : {70U, 80U, 90U}) CHECK(reader.u32() == count);
    for (int place : {1, 2}) {
        counts.back() = static_cast<std::uint8_t>(place);
        desk.send(rig::kReference, counts);
        CHECK(desk.result() == (place == 1 ? rig::kNoIndex : rig::kBadValue));
    }
    counts.back() = 1;
    desk.inputs.indexed = true;  // here, but an encoder is missing
    desk.inputs.jaw = rig::kMissing;
    desk.run(1);
    desk.inputs.indexed = false;
    desk.inputs.jaw = 0;
    desk.run(150);
    desk.send(rig::kReference, counts);
    CHECK(desk.result() == rig::kNoIndex);
    reader.u32();
    CHECK(reader.u16() == 5);
    CHECK(reader.u16() == 65536 - 6);
}

TEST_CASE("a setpoint at an end of the travel is taken and followed, one beyond it is refused") {
    rig::ReferenceFields limits = widest();
    limits.min_spindle = -9;
    limits.max_spindle = 9;
    limits.choice.watchdog_us = rig::kMinWatchdogUs;
    Desk desk(limits);
    desk.arm();
    REQUIRE(desk.result() == rig::kOk);
    for (std::int32_t end : {-9, 9}) {
        desk.setpoints({end});
        CHECK(desk.result() == rig::kOk);
        desk.run(1);
        CHECK(static_cast<std::int32_t>(word(desk.sample, 24)) == end);
        desk.setpoints({end < 0 ? end - 1 : end + 1});
        CHECK(desk.result() == rig::kBadValue);
    }
}

TEST_CASE("a motor's heat outlives its session, and a hot motor is not armed until it has cooled") {
    rig::ReferenceFields limits = widest();
    limits.motor.continuous_current = 100;
    limits.motor.i2t = 3000;
    Desk desk(limits);
    desk.arm();
    desk.inputs.current = 200;
    desk.setpoints(std::vector<std::int32_t>(100));
    desk.run(30);
    desk.ping();
    desk.run(30);  // 30000 counts^2 for 60 ms is more than half of what is allowed
    REQUIRE(desk.board.in_force());
    desk.send(rig::kDisarm, {});
    desk.arm();
    CHECK(desk.result() == rig::kTooHot);
    desk.inputs.current = 0;
    desk.run(40);
    desk.arm();
    REQUIRE(desk.result() == rig::kOk);
    desk.inputs.current = 200;
    desk.setpoints(std::vector<std::int32_t>(100));
    desk.run(40);
    desk.ping();
    desk.run(40);  // a cold motor would have 100 ms
    CHECK(desk.board.trip() == rig::kOverheated);
}

TEST_CASE("a board over no trip reports none") {
    Desk desk(widest());
    desk.send(rig::kTrip, {});
    const Bytes nothing{rig::kNoTrip, rig::kNoChannel, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    CHECK(Bytes(desk.answer.begin() + 4, desk.answer.end()) == nothing);
}

TEST_CASE("a command whose answer was lost is answered again and not carried out again") {
    Desk desk(widest());
    desk.arm();
    REQUIRE(desk.result() == rig::kOk);
    desk.send(Bytes(desk.sent));
    CHECK(desk.result() == rig::kOk);
    desk.setpoints({3, 4});
    desk.send(Bytes(desk.sent));
    CHECK(desk.result() == rig::kOk);
    CHECK(rig::Reader(desk.answer.data() + 8).u16() == rig::kQueueCapacity - 2);
}

TEST_CASE("a block of setpoints older than one that was taken is refused") {
    Desk desk(widest());
    desk.arm();
    desk.setpoints({3});
    const Bytes old = desk.sent;
    desk.setpoints({4});
    desk.send(old);
    CHECK(desk.result() == rig::kOldSequence);
}

TEST_CASE("ticks that were not run play their setpoints, and the last one stays") {
    Desk desk(widest());
    desk.arm();
    desk.setpoints({1, 2, 3});
    desk.board.skip(2);
    desk.run(1);
    CHECK(word(desk.sample, 4) == 2);
    CHECK(word(desk.sample, 24) == 3);
    desk.setpoints({4});
    desk.board.skip(9);
    desk.run(1);
    CHECK(word(desk.sample, 24) == 4);
    desk.send(rig::kStop, {});
    CHECK(rig::Reader(desk.answer.data() + 8).u16() == rig::kQueueCapacity);
}

TEST_CASE("a queue that may be dry for one tick is not dry before its first setpoint") {
    rig::ReferenceFields limits = widest();
    limits.choice.dry_ticks = 1;
    Desk desk(limits);
    desk.arm();
    desk.run(3);
    CHECK(desk.board.in_force());
    desk.setpoints({0});
    desk.run(2);
    CHECK(desk.board.in_force());
    desk.run(1);
    CHECK(desk.board.trip() == rig::kQueueRanDry);
}

TEST_CASE("a rig that is to hold holds over what leaves its encoders in no doubt, for its time, and only once it moved") {
    struct Case {
        rig::Trip code;
        void (*limit)(rig::ReferenceFields&);
        bool moves, holds;
    };
    const Case cases[] = {
        {rig::kHostSilent, [](rig::ReferenceFields&) {}, true, true},
        {rig::kHostSilent, [](rig::ReferenceFields&) {}, false, false},
        {rig::kQueueRanDry, [](rig::ReferenceFields& l) { l.choice.dry_ticks = 3; }, true, true},
        {rig::kSensorStale, [](rig::ReferenceFields& l) { l.choice.stale_ticks = 9; }, true, true},
        {rig::kOverCurrent, [](rig::ReferenceFields& l) { l.max_current = 0; }, true, false},
    };
    for (const Case& one : cases) {
        CAPTURE(&one - cases);
        rig::ReferenceFields limits = widest();
        limits.choice.safe_state = rig::kHold;
        limits.choice.hold_ticks = 5;
        one.limit(limits);
        Desk desk(limits);
        desk.arm();
        REQUIRE(desk.result() == rig::kOk);
        if (one.moves) desk.setpoints({0, 0});
        for (int tick = 0; desk.board.trip() == rig::kNoTrip && tick < 100; ++tick) desk.run(1);
        CHECK(desk.board.trip() == one.code);
        CHECK(desk.board.in_force() == one.holds);
        desk.run(4);
        CHECK(desk.board.in_force() == one.holds);
        desk.run(2);
        CHECK_FALSE(desk.board.in_force());
    }
}

TEST_CASE("encoders are at rest once none counted for a tenth of a second") {
    Desk desk(widest());
    Bytes counts(13);
    desk.run(99);
    desk.send(rig::kReference, counts);
    CHECK(desk.result() == rig::kNotAtRest);
    desk.run(1);
    desk.send(rig::kReference, counts);
    CHECK(desk.result() == rig::kOk);
}

TEST_CASE("a hello is answered with the serial number, the clock of a pong begins at 0") {
    Desk desk(widest());
    desk.ping();
    CHECK(word(desk.answer, 12) == 0);
    desk.send(rig::kHello, {});
    const Bytes serial(desk.answer.begin() + 16, desk.answer.begin() + 16 + rig::kSerialSize);
    Bytes known{'D', 'E', 'S', 'K'};
    known.resize(rig::kSerialSize);
    CHECK(serial == known);
}

TEST_CASE("setpoints of an earlier session are not played") {
    Desk desk(widest());
    desk.arm();
    desk.setpoints({1, 2, 3, 4, 5});
    desk.run(2);
    desk.send(rig::kDisarm, {});
    CHECK(rig::Reader(desk.answer.data() + 8).u16() == rig::kQueueCapacity);
    desk.arm();
    desk.run(2);
    CHECK(word(desk.sample, 24) == 0);
}

TEST_CASE("a target follows the one before it by its step at most, in a block, a queue and behind one") {
    rig::ReferenceFields limits = widest();
    limits.loop.max_target_step = 5;
    Desk desk(limits);
    desk.arm();
    desk.setpoints({100, 105});
    CHECK(desk.result() == rig::kOk);
    desk.setpoints({111});
    CHECK(desk.result() == rig::kTooFast);
    desk.setpoints({110, 116});
    CHECK(desk.result() == rig::kTooFast);
    desk.run(3);
    desk.setpoints({111});
    CHECK(desk.result() == rig::kTooFast);
    desk.setpoints({110});
    CHECK(desk.result() == rig::kOk);
}

TEST_CASE("a block has as many setpoints as the contract allows") {
    Desk desk(widest());
    desk.arm();
    const std::size_t most = rig::ReferenceProfile::kMaxSetpoints;
    desk.setpoints(std::vector<std::int32_t>(most));
    CHECK(desk.result() == rig::kOk);
    desk.setpoints(std::vector<std::int32_t>(most + 1));
    CHECK(desk.result() == rig::kWrongSize);
}

TEST_CASE("a rig that is not simulated is armed behind a reference, and not before") {
    Desk desk(widest());
    desk.board.booted(2, false);
    desk.run(100);
    desk.arm();
    CHECK(desk.result() == rig::kNotReferenced);
    desk.send(rig::kReference, Bytes(13));
    REQUIRE(desk.result() == rig::kOk);
    desk.arm();
    CHECK(desk.result() == rig::kOk);
}

}  // namespace board
