// Sequences from seeds against the core, with the rules of world.hpp held at every tick.
//
//   hunt SETTINGS commands|faults FIRST COUNT [MOST]
//
// SETTINGS: gains and limits as in an arm command behind its session; they are the board's own limits, too.
// commands: hosts that send anything at any time. faults: one honest host, and a rig and a link that fail.
// Each seed that breaks a rule is printed with its events, shrunk to as few as still break it. The last line
// has the figures. MOST: ends behind so many broken sequences. Exit code 1 where a rule was broken.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "world.hpp"

namespace {

using proofs::Bytes;
using proofs::Random;
using proofs::SensorFault;
using proofs::World;

constexpr double kExcursionRad = 0.0873;  // 5 degrees beyond the travel
constexpr int kTravelCounts = 3911;       // 3 rad of the spindle
constexpr double kTravelRad = 3.0;

struct Event {
    int tick;
    int kind;
    std::uint64_t seed;  // of what the event chooses
};

// ------------------------------------------------------------------ one honest host, and faults

const char* const kFaultNames[] = {
    "encoder frozen",      "encoder reversed",   "encoder loses counts", "encoder missing",
    "encoder jumps",       "plugs swapped",      "all encoders dead",    "current read-back dead",
    "current at its end",  "frames lost",        "frame damaged",        "frame repeated",
    "frames re-ordered",   "host pauses",        "host dies",            "second host asks",
    "second host disarms", "second host arms",   "old frame replayed",   "ticks late",
    "board restarts",      "emergency stop",     "load motor pulls", "torque sensor at its end",
};
constexpr int kFaultKinds = sizeof kFaultNames / sizeof kFaultNames[0];

class Honest {
  public:
    explicit Honest(World& world, Random& random) : world_(world) {
        amplitude_ = random.between(200, 3880);
        period_ = random.between(2000, 8000);
    }

    bool dead = false;
    int paused = 0;
    int lose = 0, damage = 0, repeat = 0, reorder = 0;
    std::vector<Bytes> sent;

    void tick(int now, Random& random) {
        if (dead || paused-- > 0) return;
        if (!begun_) {
            begin(random);
        } else if (now % 20 == 0) {
            pass(world_.ping(next(), world_.live()), random);
        }
        while (begun_ && queued_ < now + 200) {
            std::vector<std::int32_t> targets;
            for (int k = 0; k < 50; ++k, ++queued_) targets.push_back(target(queued_));
            pass(world_.setpoints(next(), session_, targets, 200), random);
        }
    }

  private:
    std::uint16_t next() { return ++number_; }
    std::int32_t target(int at) const {
        return static_cast<std::int32_t>(-amplitude_ * std::sin(6.283 * at / period_));
    }
    void begin(Random& random) {
        begun_ = true;
        session_ = world_.offer();
        pass(world_.arm(next(), session_), random);
    }
    // Sends a frame over a link that may fail.
    void pass(const Bytes& payload, Random& random) {
        Bytes wire = proofs::wire_of(payload);
        sent.push_back(wire);
        if (lose > 0) {
            --lose;
            return;
        }
        if (damage > 0) {
            --damage;
            wire[static_cast<std::size_t>(random.below(static_cast<int>(wire.size())))] ^=
                static_cast<std::uint8_t>(1 << random.below(8));
        }
        if (reorder > 0) {
            --reorder;
            held_.push_back(wire);
            return;
        }
        world_.deliver(wire);
        if (repeat > 0) {
            --repeat;
            world_.deliver(wire);
        }
        while (!held_.empty()) {
            const Bytes late = held_.back();
            held_.pop_back();
            world_.deliver(late);
        }
    }

    World& world_;
    std::vector<Bytes> held_;
    std::uint32_t session_ = 0;
    std::uint16_t number_ = 10;
    int amplitude_, period_, queued_ = 0;
    bool begun_ = false;
};

void strike(World& world, Honest& host, const Event& event) {
    Random random(event.seed);
    const int encoder = random.below(3);
    const auto set = [&](int channel, SensorFault::Kind kind) { world.faults[channel].kind = kind; };
    switch (event.kind) {
        case 0: return set(encoder, SensorFault::kFrozen);
        case 1: return set(encoder, SensorFault::kReversed);
        case 2: return set(encoder, SensorFault::kLosesCounts);
        case 3: return set(encoder, SensorFault::kMissing);
        case 4: return world.jump(encoder, random.between(-3000, 3000));
        case 5: world.swapped = random.below(2) ? proofs::kMotor : proofs::kJaw; return;
        case 6:
            for (int k = 0; k < 3; ++k) set(k, SensorFault::kFrozen);
            return;
        case 7: return set(proofs::kCurrent, SensorFault::kDead);
        case 8: return set(proofs::kCurrent, SensorFault::kFullScale);
        case 9: host.lose = random.between(1, 20); return;
        case 10: host.damage = random.between(1, 5); return;
        case 11: host.repeat = random.between(1, 5); return;
        case 12: host.reorder = random.between(1, 3); return;
        case 13: host.paused = random.between(1, 400); return;
        case 14: host.dead = true; return;
        case 15: return world.send(world.header(rig::kHello, static_cast<std::uint16_t>(random.below(65536))));
        case 16: return world.send(world.header(rig::kDisarm, 7));
        case 17:
            world.send(world.header(rig::kHello, 5));
            return world.send(world.arm(6, world.offer()));
        case 18:
            if (host.sent.empty()) return;
            return world.deliver(host.sent[random.next() % host.sent.size()]);
        case 19: return world.late(random.between(2, 30));
        case 20: return world.restart();
        case 21: world.estop = random.below(4) != 0; return;
        case 22: return world.pull(1e-3 * random.between(-250, 250));
        default: return set(proofs::kProximal + random.below(2), SensorFault::kFullScale);
    }
}

std::vector<Event> faults_of(std::uint64_t seed) {
    Random random(~seed);
    std::vector<Event> events;
    const int count = random.between(1, 8);
    for (int k = 0; k < count; ++k) {
        events.push_back({random.between(20, 2500), random.below(kFaultKinds), random.next()});
    }
    std::sort(events.begin(), events.end(), [](const Event& a, const Event& b) { return a.tick < b.tick; });
    return events;
}

void ride(World& world, std::uint64_t seed, const std::vector<Event>& events) {
    Random random(seed);
    Honest host(world, random);
    std::size_t next = 0;
    for (int now = 0; now < 3000 && world.violation.empty(); ++now) {
        while (next < events.size() && events[next].tick <= now) strike(world, host, events[next++]);
        host.tick(now, random);
        world.run(1);
        if (std::fabs(world.angle()) > kTravelRad + kExcursionRad && world.violation.empty()) {
            world.violation = "the spindle is more than 5 degrees beyond its travel";
        }
    }
}

// ------------------------------------------------------------------ hosts that send anything

const char* const kCommandNames[] = {
    "hello",     "arm as offered",  "arm with another number", "arm with other limits", "setpoints ahead",
    "setpoints beyond", "setpoints of another session", "setpoints with an old number", "ping",
    "ping of another session", "disarm", "clear by name", "clear by another name", "reference",
    "stop and start", "repeat of an earlier frame", "half a frame", "a damaged frame", "noise",
    "time passes", "much time passes", "an encoder fails", "emergency stop", "a late tick", "the board restarts",
};
constexpr int kCommandKinds = sizeof kCommandNames / sizeof kCommandNames[0];

std::vector<Event> commands_of(std::uint64_t seed) {
    Random random(~seed);
    std::vector<Event> events;
    const int count = random.between(5, 60);
    // most begin as a session does, so that what follows meets an armed board
    if (random.below(4) != 0) {
        for (int kind : {0, 1, 4, 4}) events.push_back({0, kind, random.next()});
    }
    for (int k = 0; k < count; ++k) {
        int kind = random.below(kCommandKinds);
        if (kind >= 21 && random.below(4) != 0) kind = random.below(21);  // these end most sequences
        events.push_back({0, kind, random.next()});
    }
    return events;
}

class Anybody {
  public:
    explicit Anybody(World& world) : world_(world) {}

    void act(const Event& event) {
        Random random(event.seed);
        World& w = world_;
        const auto number = static_cast<std::uint16_t>(random.below(65536));
        switch (event.kind) {
            case 0: return send(w.header(rig::kHello, number));
            case 1:
                number_ = number;
                queued_ = w.spindle();
                return send(w.arm(number, w.offer()));
            case 2: return send(w.arm(number, random.below(2) ? w.live() : static_cast<std::uint32_t>(random.next())));
            case 3: {
                Bytes payload = w.arm(number, w.offer());
                for (int k = random.between(1, 4); k > 0; --k) {
                    const std::size_t behind = rig::kSessionSize;
                    const std::size_t place = behind + random.next() % (payload.size() - behind);
                    payload[place] = static_cast<std::uint8_t>(random.below(2) ? 0xFF : random.below(256));
                }
                return send(payload);
            }
            case 4: return ahead(random, w.live(), ++number_);
            case 5: {
                const int far = kTravelCounts + random.between(1, 1000000);
                std::vector<std::int32_t> targets(static_cast<std::size_t>(random.between(1, 100)), queued_);
                targets[random.next() % targets.size()] = random.below(2) ? far : -far;
                return send(w.setpoints(++number_, w.live(), targets, random.between(-2000, 2000)));
            }
            case 6: return ahead(random, static_cast<std::uint32_t>(random.next()), ++number_);
            case 7: return ahead(random, w.live(), static_cast<std::uint16_t>(number_ - random.below(100)));
            case 8: return send(w.ping(++number_, w.live()));
            case 9: return send(w.ping(number, static_cast<std::uint32_t>(random.next())));
            case 10: return send(w.header(rig::kDisarm, number));
            case 11: return clear(number, w.trip());
            case 12: return clear(number, static_cast<unsigned>(random.below(256)));
            case 13: {
                Bytes payload = w.header(rig::kReference, number);
                for (int k = 0; k < 3; ++k) proofs::put(payload, random.next(), 4);
                return send(payload);
            }
            case 14:
                send(w.header(rig::kStop, number));
                return send(w.header(rig::kStart, static_cast<std::uint16_t>(number + 1)));
            case 15:
                if (!sent_.empty()) w.deliver(sent_[random.next() % sent_.size()]);
                return;
            case 16:
            case 17: {
                if (sent_.empty()) return;
                Bytes wire = sent_[random.next() % sent_.size()];
                const std::size_t place = random.next() % wire.size();
                if (event.kind == 16) wire.resize(place);
                if (event.kind == 17) wire[place] ^= static_cast<std::uint8_t>(1 << random.below(8));
                return w.deliver(wire);
            }
            case 18: {
                Bytes noise(static_cast<std::size_t>(random.between(1, 300)));
                for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(random.below(256));
                return w.deliver(noise);
            }
            case 19: return w.run(random.between(1, 20));
            case 20: return w.run(random.between(20, 200));
            case 21:
                w.faults[random.below(proofs::kChannels)].kind =
                    static_cast<SensorFault::Kind>(random.between(0, 6));
                return;
            case 22: w.estop = random.below(2) != 0; return;
            case 23: return w.late(random.between(2, 100));
            default: return w.restart();
        }
    }

  private:
    void send(const Bytes& payload) {
        sent_.push_back(proofs::wire_of(payload));
        world_.deliver(sent_.back());
    }
    void clear(std::uint16_t number, unsigned code) {
        Bytes payload = world_.header(rig::kClear, number);
        proofs::put(payload, code, 1);
        send(payload);
    }
    void ahead(Random& random, std::uint32_t session, std::uint16_t number) {
        std::vector<std::int32_t> targets(static_cast<std::size_t>(random.between(1, 100)));
        const int step = random.between(-4, 4);
        for (std::int32_t& target : targets) {
            queued_ = static_cast<std::int32_t>(static_cast<std::uint32_t>(queued_) +
                                                static_cast<std::uint32_t>(step));
            target = queued_;
        }
        send(world_.setpoints(number, session, targets, random.between(-1300, 1300)));
    }

    World& world_;
    std::vector<Bytes> sent_;
    std::uint16_t number_ = 100;
    std::int32_t queued_ = 0;
};

void play(World& world, const std::vector<Event>& events) {
    Anybody anybody(world);
    for (const Event& event : events) {
        if (!world.violation.empty()) return;
        anybody.act(event);
        world.run(1);
    }
    world.run(300);
}

// ------------------------------------------------------------------ both

struct Sums {
    std::uint64_t sequences = 0, broken = 0, ticks = 0, armings = 0, trips = 0;
    double farthest_rad = 0;
};

std::string outcome(bool faults, std::uint64_t seed, const proofs::Settings& settings,
                    const std::vector<Event>& events, Sums* sums) {
    World world(seed, settings);
    faults ? ride(world, seed, events) : play(world, events);
    if (sums != nullptr) {
        ++sums->sequences;
        sums->ticks += world.ticks;
        sums->armings += world.armings;
        sums->trips += world.trips;
        sums->farthest_rad = std::max(sums->farthest_rad, world.farthest_rad);
    }
    return world.violation;
}

// Leaves out events as long as the same rule is broken without them.
std::vector<Event> shrunk(bool faults, std::uint64_t seed, const proofs::Settings& settings,
                          std::vector<Event> events, const std::string& rule) {
    for (std::size_t piece = events.size(); piece > 0; piece /= 2) {
        for (std::size_t at = 0; at + piece <= events.size();) {
            std::vector<Event> fewer = events;
            const auto from = fewer.begin() + static_cast<std::ptrdiff_t>(at);
            fewer.erase(from, from + static_cast<std::ptrdiff_t>(piece));
            if (outcome(faults, seed, settings, fewer, nullptr) == rule) {
                events = fewer;
            } else {
                ++at;
            }
        }
    }
    return events;
}

}  // namespace

int main(int count, char** words) {
    if (count < 5) return std::fprintf(stderr, "hunt SETTINGS commands|faults FIRST COUNT\n"), 2;
    proofs::Settings settings;
    if (!proofs::read_settings(words[1], settings)) return std::fprintf(stderr, "no settings\n"), 2;
    const bool faults = std::strcmp(words[2], "faults") == 0;
    const std::uint64_t first = std::strtoull(words[3], nullptr, 10);
    const std::uint64_t last = first + std::strtoull(words[4], nullptr, 10);
    const std::uint64_t most = count > 5 ? std::strtoull(words[5], nullptr, 10) : ~std::uint64_t{0};
    Sums sums;
    for (std::uint64_t seed = first; seed < last && sums.broken < most; ++seed) {
        const std::vector<Event> events = faults ? faults_of(seed) : commands_of(seed);
        const std::string rule = outcome(faults, seed, settings, events, &sums);
        if (rule.empty()) continue;
        ++sums.broken;
        std::printf("seed %llu: %s:", static_cast<unsigned long long>(seed), rule.c_str());
        for (const Event& event : shrunk(faults, seed, settings, events, rule)) {
            std::printf(" [%s", faults ? kFaultNames[event.kind] : kCommandNames[event.kind]);
            if (faults) std::printf(" at %d ms", event.tick);
            std::printf("]");
        }
        std::printf("\n");
    }
    std::printf(
        "{\"sequences\": %llu, \"broken\": %llu, \"ticks\": %llu, \"armings\": %llu, \"trips\": %llu, "
        "\"farthest_rad\": %.4f}\n",
        static_cast<unsigned long long>(sums.sequences), static_cast<unsigned long long>(sums.broken),
        static_cast<unsigned long long>(sums.ticks), static_cast<unsigned long long>(sums.armings),
        static_cast<unsigned long long>(sums.trips), sums.farthest_rad);
    return sums.broken != 0 ? 1 : 0;
}
