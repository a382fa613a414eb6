// Every small input of the core's parts, and every short sequence of commands: a check that is complete up to a
// stated size. To be built with -fsanitize=address,undefined: then no overflow and no access out of bounds either.
//
//   small SETTINGS [DEPTH]
//
// SETTINGS: gains and limits as in an arm command behind its session. DEPTH: length of the sequences of commands.
// Prints one line a part, `name: cases`, and ends with 1 at the first case that fails.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <limits>

#include "world.hpp"

namespace {

using proofs::Bytes;
using proofs::World;
using Cases = unsigned long long;

void require(bool holds, const char* what) {
    if (holds) return;
    std::printf("FAILED: %s\n", what);
    std::exit(1);
}

// Calls `visit` with every string of at most `longest` letters.
template <class Visit>
Cases strings(const Bytes& alphabet, std::size_t longest, Visit visit) {
    Cases cases = 0;
    for (std::size_t length = 0; length <= longest; ++length) {
        std::vector<std::size_t> at(length, 0);
        while (true) {
            Bytes text;
            for (std::size_t k : at) text.push_back(alphabet[k]);
            visit(text);
            ++cases;
            std::size_t k = 0;
            while (k < length && ++at[k] == alphabet.size()) at[k++] = 0;
            if (k == length) break;
        }
    }
    return cases;
}

Bytes all_bytes() {
    Bytes bytes(256);
    for (std::size_t k = 0; k < 256; ++k) bytes[k] = static_cast<std::uint8_t>(k);
    return bytes;
}

void round_trip(const Bytes& data) {
    Bytes coded(data.size() + data.size() / rig::kMaxBlock + 1);
    const std::size_t length = rig::cobs_encode(data.data(), data.size(), coded.data());
    require(length <= coded.size(), "an encoded string is longer than stated");
    coded.resize(length);
    require(std::find(coded.begin(), coded.end(), 0) == coded.end(), "a zero in an encoded string");
    const std::ptrdiff_t size = rig::cobs_decode(coded.data(), length);
    require(size == static_cast<std::ptrdiff_t>(data.size()), "a decoded string has another length");
    require(std::equal(data.begin(), data.end(), coded.begin()), "a decoded string differs");
}

Cases cobs_round_trips() {
    Cases cases = strings({0, 1, 2, 255}, 8, round_trip);
    for (std::size_t size = 1; size <= rig::kMaxBody; ++size) {  // blocks of 254 end where they may
        round_trip(Bytes(size, 7));
        round_trip(Bytes(size, 0));
        Bytes one_zero(size, 7);
        one_zero[size - 1] = 0;
        round_trip(one_zero);
        one_zero[size - 1] = 7;
        one_zero[size / 2] = 0;
        round_trip(one_zero);
        cases += 4;
    }
    for (std::size_t place = 0; place < 600; ++place) {
        Bytes one_zero(600, 7);
        one_zero[place] = 0;
        round_trip(one_zero);
        ++cases;
    }
    return cases;
}

Cases cobs_any_bytes() {
    const auto decode = [](const Bytes& text) {
        Bytes copy = text;
        const std::ptrdiff_t size = rig::cobs_decode(copy.data(), copy.size());
        require(size == -1 || size <= static_cast<std::ptrdiff_t>(text.size()), "decoding makes bytes");
    };
    return strings(all_bytes(), 2, decode) + strings({0, 1, 2, 3, 4, 5, 254, 255}, 7, decode);
}

std::uint16_t crc_by_bits(const Bytes& data) {
    unsigned crc = 0xFFFF;
    for (std::uint8_t byte : data) {
        for (int bit = 7; bit >= 0; --bit) {
            const unsigned top = (crc >> 15 & 1) ^ (byte >> bit & 1U);
            crc = (crc << 1 & 0xFFFF) ^ (top != 0 ? 0x1021U : 0U);
        }
    }
    return static_cast<std::uint16_t>(crc);
}

Cases crc_values() {
    return strings(all_bytes(), 2, [](const Bytes& text) {
        require(rig::crc16(text.data(), text.size()) == crc_by_bits(text), "a CRC differs");
    });
}

// All damage of one or two bits, and of up to 16 in a row, in a frame of 24 bytes: always noticed.
Cases crc_damage() {
    Bytes body(22, 0x5A);
    const std::uint16_t crc = rig::crc16(body.data(), body.size());
    body.push_back(static_cast<std::uint8_t>(crc >> 8));
    body.push_back(static_cast<std::uint8_t>(crc & 0xFF));
    require(rig::crc16(body.data(), body.size()) == 0, "a CRC behind its data is not 0");
    const std::size_t bits = 8 * body.size();
    const auto flip = [&](std::size_t bit) {
        body[bit / 8] = static_cast<std::uint8_t>(body[bit / 8] ^ 0x80 >> bit % 8);
    };
    Cases cases = 0;
    for (std::size_t one = 0; one < bits; ++one) {
        for (std::size_t other = one; other < bits; ++other) {
            flip(one);
            if (other != one) flip(other);
            require(rig::crc16(body.data(), body.size()) != 0, "two damaged bits pass");
            flip(one);
            if (other != one) flip(other);
            ++cases;
        }
        for (unsigned burst = 1; burst < 0x8000; burst += 1) {  // the first bit of 16 is always damaged
            if (one + 16 > bits) break;
            flip(one);
            for (std::size_t k = 0; k < 15; ++k) {
                if ((burst >> k & 1) != 0) flip(one + 1 + k);
            }
            require(rig::crc16(body.data(), body.size()) != 0, "a burst passes");
            flip(one);
            for (std::size_t k = 0; k < 15; ++k) {
                if ((burst >> k & 1) != 0) flip(one + 1 + k);
            }
            ++cases;
        }
    }
    return cases;
}

// Behind any bytes and a delimiter the receiver is in step again.
Cases receiver_recovers() {
    const Bytes good = proofs::wire_of({1, 2, 3, 0, 255});
    return strings({0, 1, 2, 3, 255}, 7, [&](const Bytes& text) {
        rig::FrameReceiver receiver;
        for (std::uint8_t byte : text) receiver.take(byte);
        receiver.take(0);
        bool whole = false;
        for (std::uint8_t byte : good) whole = receiver.take(byte);
        require(whole && receiver.size() == 5, "a good frame is lost behind a bad one");
    });
}

Cases sequence_window() {
    Cases cases = 0;
    for (int newest = 0; newest < 65536; newest += 257) {
        for (int ahead = 0; ahead < 65536; ++ahead) {
            rig::Session session;
            session.begin(1, static_cast<std::uint16_t>(newest));
            const bool is_new = session.is_new(static_cast<std::uint16_t>(newest + ahead));
            require(is_new == (0 < ahead && ahead < 32768), "the window of sequence numbers");
            ++cases;
        }
    }
    return cases;
}

Cases offers_differ() {
    std::vector<std::uint32_t> offers;
    for (std::uint32_t boot = 1; boot <= 16; ++boot) {
        rig::Session session;
        session.booted(boot);
        for (int attempt = 0; attempt < 65536; ++attempt) {
            const std::uint32_t offer = session.offer();
            require(!session.attempt(offer ^ 1), "an attempt with another number");
            require(session.attempt(offer), "an attempt with the offered number");
            offers.push_back(offer);
        }
    }
    std::sort(offers.begin(), offers.end());
    const bool twice = std::adjacent_find(offers.begin(), offers.end()) != offers.end();
    require(!twice, "a number is offered twice");
    return offers.size();
}

// Every sequence of pushes and pops on a queue of four, next to a queue of the standard library.
Cases queue_sequences() {
    return strings({0, 1, 2, 3, 4}, 9, [](const Bytes& actions) {
        rig::SetpointQueue<int, 4> queue;
        std::deque<int> model;
        int value = 0;
        for (std::uint8_t action : actions) {
            if (action == 4) {
                queue.clear();
                model.clear();
            } else if (action == 0) {
                if (queue.empty()) continue;
                require(queue.pop() == model.front(), "a queue gives another value");
                model.pop_front();
            } else if (queue.free() >= action) {
                int block[3];
                for (int k = 0; k < action; ++k) model.push_back(block[k] = ++value);
                queue.push(block, action);
            }
            require(queue.free() == 4 - model.size(), "a queue counts wrong");
            require(queue.empty() == model.empty(), "a queue is empty or not");
            if (model.empty()) continue;
            require(queue.oldest() == model.front() && queue.newest() == model.back(), "a queue's ends");
        }
    });
}

Cases watchdog_sequences() {
    return strings({0, 1, 2, 3}, 10, [](const Bytes& actions) {
        rig::Watchdog watchdog;
        std::uint32_t now = 0xFFFFF000U;  // the clock wraps on the way
        watchdog.heard();
        watchdog.silent_us(now);
        std::uint32_t silent = 0;
        bool heard = false;
        for (std::uint8_t action : actions) {
            if (action == 0) {
                watchdog.heard();
                heard = true;
                continue;
            }
            const std::uint32_t step = action == 1 ? 1000U : action == 2 ? 30000U : 3000000000U;
            now += step;
            silent = heard ? 0 : silent + step;
            heard = false;
            require(watchdog.silent_us(now) == silent, "a watchdog counts wrong");
        }
    });
}

constexpr std::int32_t kEnds[] = {INT32_MIN, INT32_MIN + 1, -1, 0, 1, INT32_MAX};

// Every combination of extreme readings, three ticks on end, under the stored limits and under none.
Cases extreme_inputs(const proofs::Settings& bytes) {
    Cases cases = 0;
    rig::ReferenceProfile::Settings stored;
    rig::Reader reader(bytes.data());
    stored.read(reader);
    rig::ReferenceProfile::Settings none = rig::ReferenceProfile::Settings::widest();
    none.gains = {1e6, 1e6, -1e6, 1, rig::kFullScaleE4};
    for (const auto& settings : {stored, none}) {
        for (int code = 0; code < 6 * 6 * 6 * 6 * 6 * 6; ++code) {
            int rest = code;
            std::int32_t now[6];
            for (std::int32_t& count : now) {
                count = kEnds[rest % 6];
                rest /= 6;
            }
            rig::ReferenceProfile profile;
            profile.begin(settings);
            const rig::ReferenceProfile::Inputs inputs[3] = {
                {}, {now[0], now[1], now[2], now[3], now[4], now[5], 0, false},
                {now[1], now[2], now[0], now[4], now[5], now[3], 0, true}};
            for (const auto& one : inputs) {
                profile.late(one, 3);
                profile.warm(one, 3);
                profile.check(one);
                const auto outputs = profile.drive({now[2], static_cast<std::int16_t>(now[3])}, one);
                require(std::abs(outputs.command_e4) <= settings.gains.limit, "a command beyond its limit");
                profile.begin_to_hold(one);
            }
            ++cases;
        }
    }
    return cases;
}

// Every sequence of that many commands and events against a board, from its start and from an armed one.
class Tree {
  public:
    explicit Tree(const proofs::Settings& settings) : start_(0, settings), armed_(0, settings) {
        act(armed_, 0);
        act(armed_, 1);
        act(armed_, 3);
        require(armed_.armed(), "a sound board is not armed");
    }
    Cases walk(int depth) {
        cases_ = 0;
        descend(start_, depth);
        descend(armed_, depth);
        return cases_;
    }

  private:
    static constexpr int kActions = 15;

    void descend(const World& world, int depth) {
        if (!world.violation.empty()) {
            std::printf("path:");
            for (int action : path_) std::printf(" %d", action);
            std::printf("\n");
            require(false, world.violation.c_str());
        }
        if (depth == 0) {
            ++cases_;
            return;
        }
        for (int action = 0; action < kActions; ++action) {
            World next = world;
            path_.push_back(action);
            act(next, action);
            descend(next, depth - 1);
            path_.pop_back();
        }
    }

    static void act(World& w, int action) {
        const std::uint16_t number = ++w.number;
        const std::int32_t here = w.spindle();
        switch (action) {
            case 0: w.send(w.header(rig::kHello, number)); break;
            case 1: w.send(w.arm(number, w.offer())); break;
            case 2: w.send(w.arm(number, w.live())); break;  // an old number
            case 3: w.send(w.setpoints(number, w.live(), {here, here + 1, here + 2}, 100)); break;
            case 4: w.send(w.setpoints(number, w.live(), {here, w.limits().max_spindle + 1}, 0)); break;
            case 5: w.send(w.setpoints(static_cast<std::uint16_t>(number - 3), w.live(), {here}, 0)); break;
            case 6: w.send(w.ping(number, w.live())); break;
            case 7: w.send(w.header(rig::kDisarm, number)); break;
            case 8: clear(w, number, w.trip()); break;
            case 9: clear(w, number, w.trip() + 1); break;
            case 10: w.run(2); break;
            case 11: w.late(60); break;  // longer than the watchdog
            case 12: w.estop = !w.estop; break;
            case 13: {
                proofs::SensorFault& fault = w.faults[proofs::kSpindle];
                const bool sound = fault.kind == proofs::SensorFault::kNone;
                fault.kind = sound ? proofs::SensorFault::kMissing : proofs::SensorFault::kNone;
                break;
            }
            default: w.restart(); break;
        }
        w.run(1);
    }
    static void clear(World& w, std::uint16_t number, unsigned code) {
        Bytes payload = w.header(rig::kClear, number);
        proofs::put(payload, code, 1);
        w.send(payload);
    }

    World start_;
    World armed_;
    Cases cases_ = 0;
    std::vector<int> path_;
};

}  // namespace

int main(int count, char** words) {
    proofs::Settings settings;
    if (count < 2 || !proofs::read_settings(words[1], settings)) {
        return std::fprintf(stderr, "small SETTINGS [DEPTH]\n"), 2;
    }
    const int depth = count > 2 ? std::atoi(words[2]) : 4;
    std::printf("COBS there and back: %llu\n", cobs_round_trips());
    std::printf("COBS of any bytes: %llu\n", cobs_any_bytes());
    std::printf("CRC against its definition: %llu\n", crc_values());
    std::printf("damaged frames: %llu\n", crc_damage());
    std::printf("receiver behind any bytes: %llu\n", receiver_recovers());
    std::printf("window of sequence numbers: %llu\n", sequence_window());
    std::printf("offered sessions: %llu\n", offers_differ());
    std::printf("queue of setpoints: %llu\n", queue_sequences());
    std::printf("watchdog: %llu\n", watchdog_sequences());
    std::printf("extreme readings: %llu\n", extreme_inputs(settings));
    std::printf("commands and events: %llu\n", Tree(settings).walk(depth));
    return 0;
}
