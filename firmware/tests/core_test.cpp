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
#include "guards_test.hpp"

using proofs::Bytes;
using proofs::World;

TEST_CASE("published check values") {
    const std::uint8_t digits[] = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
    CHECK(rig::crc16(digits, 9) == 0x29B1);
    const std::uint8_t data[] = {0x11, 0x00, 0x00, 0x22, 0x33};
    std::uint8_t out[8];
    REQUIRE(rig::cobs_encode(data, 5, out) == 6);
    CHECK(Bytes(out, out + 6) == Bytes{0x02, 0x11, 0x01, 0x03, 0x22, 0x33});
    CHECK(rig::crc32("123456789") == 0xCBF43926U);
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


namespace {

// A reference board, what it sent, and its ticks; everything within every limit but those a test sets.
class Desk {
  public:
    explicit Desk(const rig::ReferenceFields& limits) {
        board.booted(1, true);
        const double gains[5] = {0, 0, 0, 0, 10000};
        for (double gain : gains) {
            std::uint64_t bits;
            std::memcpy(&bits, &gain, sizeof bits);
            proofs::put(settings_, bits, 8);
        }
        rig::ReferenceFields::each(limits, limits, [&](std::int32_t limit, std::int32_t, rig::Sense) {
            proofs::put(settings_, static_cast<std::uint32_t>(limit), 4);
        });
        send(rig::kHello, {});
        send(rig::kStart, {});
    }

    proofs::TestBoard board{"DESK"};
    rig::ReferenceProfile::Inputs inputs;
    Bytes answer;  // the newest
    Bytes sample;  // the newest
    int samples = 0;

    void send(rig::Kind kind, const Bytes& body) {
        Bytes payload = World::header(kind, ++number_);
        payload.insert(payload.end(), body.begin(), body.end());
        send(payload);
        if (kind == rig::kHello) session_ = rig::Reader(&*(answer.end() - 4)).u32();
    }
    rig::Result result() const { return static_cast<rig::Result>(answer[5]); }
    void arm() {
        send(rig::kHello, {});
        Bytes body;
        proofs::put(body, session_, 4);
        body.insert(body.end(), settings_.begin(), settings_.end());
        send(rig::kArm, body);
    }
    // A block of setpoints: targets, no load.
    void setpoints(const std::vector<std::int32_t>& targets) {
        send(World::setpoints(++number_, session_, targets, 0));
    }
    void ping() { send(World::ping(++number_, session_)); }
    void run(int ticks) {
        for (int k = 0; k < ticks; ++k) {
            now_us_ += 1000;
            inputs.current ^= 1;  // none of the sensors stays
            board.tick(now_us_, inputs);
            take();
        }
    }

  private:
    void send(const Bytes& payload) {
        const Bytes wire = proofs::wire_of(payload);
        board.receive<rig::NoLock>(wire.data(), wire.size());
        take();
    }
    void take() {
        proofs::drain(board, frames_, [this](const std::uint8_t* payload, std::size_t size) {
            const bool is_sample = payload[1] == rig::kSample;
            samples += is_sample;
            (is_sample ? sample : answer).assign(payload, payload + size);
        });
    }

    rig::FrameReceiver frames_;
    Bytes settings_;
    std::uint32_t session_ = 0;
    std::uint32_t now_us_ = 0;
    std::uint16_t number_ = 0;
};

rig::ReferenceFields widest() {
    rig::ReferenceFields limits = rig::widest<rig::ReferenceFields>();
    limits.choice.watchdog_us = 50000;
    limits.choice.hold_command_e4 = 0;
    return limits;
}

std::uint32_t word(const Bytes& frame, std::size_t at) { return rig::Reader(frame.data() + at).u32(); }

}  // namespace

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

TEST_CASE("the place of the index gives the reference once, and not after a trip that doubts an encoder") {
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
    pass_index();
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

TEST_CASE("a board that is built for one sign of the gain takes no other") {
    const rig::Gains toward{20, 0, 0, 0.3, 2700}, away{-20, 0, 0, 0.3, 2700}, own{1, 0, 0, 0, 3000}, any{0, 0, 0, 0, 3000};
    CHECK(toward.within(own));
    CHECK_FALSE(away.within(own));
    CHECK(away.within(any));
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

TEST_CASE("a command number is new up to half the range ahead, and an old one never is") {
    rig::Session session;
    session.begin(1, 100);
    for (unsigned ahead : {1U, 2U, 0x7FFFU}) CHECK(session.is_new(static_cast<std::uint16_t>(100 + ahead)));
    for (unsigned ahead : {0U, 0x8000U, 0xFFFFU}) CHECK_FALSE(session.is_new(static_cast<std::uint16_t>(100 + ahead)));
}

TEST_CASE("a controller that begins at a motor far from 0 does not take that for a speed") {
    rig::Controller controller;
    controller.reset({0, 0, 1, 1, 10000});
    CHECK(controller.tick(0, 0, 500) == 0);
    CHECK(controller.tick(0, 0, 507) == 7);
}

TEST_CASE("a late tick is judged by its time: travel at the same speed is no jump, and more is") {
    for (int step : {10, 11}) {
        rig::ReferenceFields limits = widest();
        limits.loop.max_motor_jump = limits.max_spindle_jump = limits.max_jaw_jump = 10;
        limits.motor.max_motor_step = 10;
        for (int channel = 0; channel < 3; ++channel) {
            rig::ReferenceProfile profile;
            rig::ReferenceProfile::Settings settings = rig::ReferenceProfile::Settings::widest();
            settings.limits = limits;
            profile.begin(settings);
            rig::ReferenceProfile::Inputs inputs;
            CHECK(profile.check(inputs).code == rig::kNoTrip);
            rig::ReferenceProfile::encoder(inputs, static_cast<std::size_t>(channel)) = 5 * step;
            profile.late(inputs, 5);
            CHECK((profile.check(inputs).code == rig::kNoTrip) == (step == 10));
        }
    }
}
