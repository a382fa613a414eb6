// A board, a rig with one inertia, and what may happen to both: sequences of events from a seed, and what must hold
// at every tick whatever happens. Positions are true angles, closing positive; counts are the reference rig's.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "../core/board.hpp"
#include "../core/profile_reference.hpp"

namespace proofs {

using Bytes = std::vector<std::uint8_t>;
using TestBoard = rig::Board<rig::ReferenceProfile, 4096>;
using Settings = std::array<std::uint8_t, rig::ReferenceProfile::kArmSize>;

class Random {
  public:
    explicit Random(std::uint64_t seed) : state_(seed) { state_ = next() ^ seed << 32; }
    std::uint64_t next() {  // splitmix64, Steele and others 2014
        std::uint64_t z = (state_ += 0x9E3779B97F4A7C15U);
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9U;
        z = (z ^ z >> 27) * 0x94D049BB133111EBU;
        return z ^ z >> 31;
    }
    int below(int count) { return static_cast<int>(next() % static_cast<std::uint64_t>(count)); }
    int between(int low, int high) { return low + below(high - low + 1); }

  private:
    std::uint64_t state_;
};

inline Bytes wire_of(const Bytes& payload) {
    Bytes body = payload;
    const std::uint16_t crc = rig::crc16(payload.data(), payload.size());
    body.push_back(static_cast<std::uint8_t>(crc & 0xFF));
    body.push_back(static_cast<std::uint8_t>(crc >> 8));
    Bytes wire(rig::kMaxWire + 1);
    std::size_t length = rig::cobs_encode(body.data(), body.size(), wire.data());
    wire[length++] = 0;
    wire.resize(length);
    return wire;
}

// Gains and limits, as in an arm command behind its session; false where the file does not hold them.
inline bool read_settings(const char* path, Settings& settings) {
    std::ifstream file(path, std::ios::binary);
    return static_cast<bool>(file.read(reinterpret_cast<char*>(settings.data()), settings.size()));
}

inline void put(Bytes& bytes, std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> 8 * i));
}

enum Channel { kMotor, kSpindle, kJaw, kProximal, kDistal, kCurrent, kChannels };

// What makes sensors wrong.
struct SensorFault {
    enum Kind { kNone, kFrozen, kReversed, kLosesCounts, kMissing, kDead, kFullScale } kind = kNone;
    std::int32_t kept = 0;
};

class Plant {
  public:
    double angle = 0;
    double pull_n_m = 0;  // of a load motor whose driver is wrong, while it is enabled

    void sample(std::int32_t (&counts)[kChannels], Random& random) const {
        const double turn = 6.283185307179586;
        counts[kMotor] = whole(angle * 4096 * 35 / turn);
        counts[kSpindle] = whole(-angle * 8192 / turn);
        counts[kJaw] = whole((1.272 + 0.913 * angle) * 4000 / turn);
        counts[kProximal] = random.between(-4, 4);
        counts[kDistal] = random.between(-4, 4);
        counts[kCurrent] = whole(1000 * current_) + random.between(-4, 4);
    }
    // Moves a millisecond.
    void step(std::int32_t command_e4, bool enabled) {
        current_ = enabled ? -2.06e-4 * command_e4 - 0.019 : 0.0;
        const double load = enabled ? pull_n_m : 0.0;
        for (int part = 0; part < kParts; ++part) {
            const double fast = speed_ / 0.02;
            const double sign = fast > 1 ? 1 : fast < -1 ? -1 : fast;
            const double friction = 0.03 * sign + 0.01 * speed_;
            speed_ += (0.467 * current_ - friction + load) / 3.3e-4 * (1e-3 / kParts);
            angle += speed_ * (1e-3 / kParts);
        }
    }

  private:
    static constexpr int kParts = 4;
    static std::int32_t whole(double value) { return static_cast<std::int32_t>(std::floor(value)); }
    double speed_ = 0;
    double current_ = 0;
};

// Gives every frame that a board has sent to `visit`.
template <class Visit>
void drain(TestBoard& board, rig::FrameReceiver& frames, Visit visit) {
    std::uint8_t bytes[4096];
    std::size_t count;
    while ((count = board.transmit(bytes, sizeof bytes)) > 0) {
        for (std::size_t k = 0; k < count; ++k) {
            if (frames.take(bytes[k])) visit(frames.payload(), frames.size());
        }
    }
}

// A board with a plant, everything a host can send it, and the rules that no host and no fault may break.
class World {
  public:
    World(std::uint64_t seed, const Settings& settings)
        : random(seed), settings_(settings), board_("PROOF") {
        rig::Reader reader(settings_.data());
        own_.read(reader);
        start_board(true);
        run(1);
    }

    Random random;
    std::string violation;  // empty while every rule holds
    std::uint64_t ticks = 0;
    std::uint64_t armings = 0;
    std::uint64_t trips = 0;
    double farthest_rad = 0;
    bool estop = false;
    std::uint16_t number = 100;  // of the newest command
    SensorFault faults[kChannels];
    int swapped = -1;  // an encoder that is at the spindle's plug, and the other way round
    const rig::ReferenceFields& limits() const { return own_.limits; }
    double angle() const { return plant_.angle; }
    bool armed() const { return (status_ & rig::kArmed) != 0; }
    unsigned trip() const { return status_ >> rig::kTripShift; }
    std::uint32_t offer() const { return offer_; }
    std::uint32_t live() const { return live_; }
    std::int32_t spindle() const { return seen_[kSpindle]; }

    // Frames.
    static Bytes header(rig::Kind kind, std::uint16_t sequence) {
        Bytes payload;
        put(payload, rig::kVersion, 1);
        put(payload, kind, 1);
        put(payload, sequence, 2);
        return payload;
    }
    Bytes arm(std::uint16_t sequence, std::uint32_t session) const {
        Bytes payload = header(rig::kArm, sequence);
        put(payload, session, 4);
        payload.insert(payload.end(), settings_.begin(), settings_.end());
        return payload;
    }
    static Bytes setpoints(std::uint16_t sequence, std::uint32_t session,
                           const std::vector<std::int32_t>& targets, int load_ma) {
        Bytes payload = header(rig::kSetpoints, sequence);
        put(payload, session, 4);
        for (std::int32_t target : targets) {
            put(payload, static_cast<std::uint32_t>(target), 4);
            put(payload, static_cast<std::uint16_t>(load_ma), 2);
        }
        return payload;
    }
    static Bytes ping(std::uint16_t sequence, std::uint32_t session) {
        Bytes payload = header(rig::kPing, sequence);
        put(payload, session, 4);
        put(payload, 0, 8);
        return payload;
    }

    // Lets the board have bytes, whole frames or not.
    void deliver(const Bytes& wire) {
        for (std::uint8_t byte : wire) {
            const bool was_armed = armed();
            const unsigned tripped = trip();
            board_.receive<rig::NoLock>(&byte, 1);
            answers();
            judge(to_board_.take(byte), was_armed, tripped);
        }
    }
    void send(const Bytes& payload) { deliver(wire_of(payload)); }

    void run(int count) {
        for (int k = 0; k < count && violation.empty(); ++k) tick(1);
    }
    // A tick that comes late: the motor keeps its command meanwhile.
    void late(int milliseconds) { tick(milliseconds); }
    // The board starts again in the middle of everything; its counts have no zeros.
    void restart() {
        start_board(false);
        run(1);
    }
    void pull(double torque_n_m) { plant_.pull_n_m = torque_n_m; }
    void jump(int channel, std::int32_t counts) { jumped_[channel] += counts; }

  private:
    // What the bytes that ended a frame, if any, may have changed.
    void judge(bool whole, bool was_armed, unsigned tripped) {
        const std::size_t size = whole ? to_board_.size() : 0;
        const std::uint8_t* payload = to_board_.payload();
        const std::uint8_t kind = size >= rig::kHeaderSize ? payload[1] : 0;
        std::uint32_t session = 0;
        if (size >= rig::kSessionSize) session = rig::Reader(payload + rig::kHeaderSize).u32();
        const bool names = kind == rig::kClear && size == rig::kHeaderSize + 1U && payload[4] == tripped;
        if (tripped != 0 && trip() == 0 && !names) {
            fail("a trip was cleared by something else than its own name");
        }
        if (!was_armed && armed()) {
            ++armings;
            if (kind != rig::kArm) fail("armed by a frame that is no arm command");
            if (session != unspent_ || session == 0) fail("armed with a number that was not offered");
            if (tripped != 0) fail("armed over a trip that was not cleared");
            live_ = session;
            heard_us_ = now_us_;
        }
        if (kind == rig::kArm && session == unspent_) unspent_ = 0;
        if (live_ != 0 && session == live_ && (kind == rig::kPing || kind == rig::kSetpoints)) {
            heard_us_ = now_us_;
        }
    }

    void fail(const char* rule) {
        if (violation.empty()) violation = rule;
    }

    void start_board(bool referenced) {
        board_ = TestBoard("PROOF");
        to_board_ = rig::FrameReceiver();
        board_.booted(++boot_, referenced);
        board_.limit_to(own_);
        live_ = unspent_ = offer_ = 0;
        status_ = 0;
        outputs_ = {};
        for (SensorFault& fault : faults) fault = {};
        send(header(rig::kHello, 1));
        send(header(rig::kStart, 2));
    }

    void tick(int milliseconds) {
        for (int k = 0; k < milliseconds; ++k) plant_.step(outputs_.command_e4, outputs_.in_force);
        now_us_ += static_cast<std::uint32_t>(1000 * milliseconds);
        ticks += static_cast<std::uint64_t>(milliseconds);
        sense();
        const rig::ReferenceProfile::Inputs inputs = {
            seen_[kMotor],    seen_[kSpindle], seen_[kJaw], seen_[kProximal],
            seen_[kDistal],   seen_[kCurrent], 0, false};
        const unsigned tripped = trip();
        outputs_ = board_.tick(now_us_, inputs, estop);
        answers();
        if (tripped == 0 && trip() != 0) ++trips;
        rules(inputs);
        farthest_rad = std::max(farthest_rad, std::fabs(plant_.angle));
    }

    static std::int32_t wrapped(std::int64_t count) {
        return static_cast<std::int32_t>(static_cast<std::uint32_t>(count));
    }
    void sense() {
        plant_.sample(seen_, random);
        for (int k = 0; k < kChannels; ++k) {
            std::int32_t& count = seen_[k];
            count = wrapped(std::int64_t{count} + jumped_[k]);
            SensorFault& fault = faults[k];
            switch (fault.kind) {
                case SensorFault::kNone:
                    fault.kept = count;
                    break;
                case SensorFault::kFrozen:
                    count = fault.kept;
                    break;
                case SensorFault::kReversed:
                    count = wrapped(2 * std::int64_t{fault.kept} - count);
                    break;
                case SensorFault::kLosesCounts:
                    count = wrapped(fault.kept + (std::int64_t{count} - fault.kept) * 9 / 10);
                    break;
                case SensorFault::kMissing:
                    count = rig::kMissing;
                    break;
                case SensorFault::kDead:
                    count = static_cast<std::int32_t>(random.between(-1, 1));
                    break;
                case SensorFault::kFullScale:
                    count = k >= kProximal ? INT16_MAX : fault.kept;
                    break;
            }
        }
        if (swapped >= 0) std::swap(seen_[swapped], seen_[kSpindle]);
    }

    // What must hold behind every tick.
    void rules(const rig::ReferenceProfile::Inputs& inputs) {
        const rig::ReferenceFields& own = own_.limits;
        const bool in_force = board_.in_force();
        if (!in_force && (outputs_.command_e4 != 0 || outputs_.load_ma != 0 || outputs_.in_force)) {
            fail("a motor is commanded that is not in force");
        }
        if (std::abs(outputs_.command_e4) > own_.gains.limit) fail("a command beyond its limit");
        if (std::abs(outputs_.load_ma) > own.max_load_ma) fail("a load beyond its limit");
        if (armed() && trip() != 0) fail("armed and tripped");
        if (!armed()) live_ = 0;
        if (!in_force) return;
        if (estop) fail("in force while the emergency stop is pressed");
        if (inputs.spindle < own.min_spindle || inputs.spindle > own.max_spindle) {
            fail("in force beyond the travel");
        }
        if (std::abs(inputs.current) > own.max_current) fail("in force above the largest current");
        if (armed() && now_us_ - heard_us_ > static_cast<std::uint32_t>(own.choice.watchdog_us) + 2000) {
            fail("armed without a sign of life of its session");
        }
        if (target_ < own.min_spindle || target_ > own.max_spindle) {
            fail("a target beyond the travel");
        }
    }

    // Reads what the board sent: its state, its offers and the targets it follows.
    void answers() {
        drain(board_, from_board_, [this](const std::uint8_t* payload, std::size_t size) { read(payload, size); });
    }
    void read(const std::uint8_t* payload, std::size_t size) {
        rig::Reader reader(payload + rig::kHeaderSize);
        if (payload[1] == rig::kSample) {
            status_ = static_cast<std::uint16_t>(payload[2] | payload[3] << 8);
            for (int k = 0; k < 2 + 3; ++k) reader.u32();
            target_ = reader.i32();
        } else if (payload[1] == rig::kAck && size == 10) {
            reader.u8();
            reader.u8();
            status_ = reader.u16();
        } else if (payload[1] == rig::kHelloReply) {
            for (std::size_t k = 0; k < 12 + rig::kSerialSize + 4; ++k) reader.u8();
            status_ = reader.u16();
            offer_ = unspent_ = reader.u32();
        }
    }

    Settings settings_;
    rig::ReferenceProfile::Settings own_;
    TestBoard board_;
    Plant plant_;
    rig::FrameReceiver from_board_;
    rig::FrameReceiver to_board_;  // in step with the board's own
    rig::ReferenceProfile::Outputs outputs_;
    std::int32_t seen_[kChannels] = {};
    std::int32_t jumped_[kChannels] = {};
    std::int32_t target_ = 0;
    std::uint32_t now_us_ = 0xFFFF0000U;  // the clock wraps soon
    std::uint32_t heard_us_ = 0;
    std::uint32_t boot_ = 0;
    std::uint32_t offer_ = 0;    // newest number that the board offered
    std::uint32_t unspent_ = 0;  // the same until somebody tries to arm with it
    std::uint32_t live_ = 0;     // the session that armed
    std::uint16_t status_ = 0;
};

}  // namespace proofs
