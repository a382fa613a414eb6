// A reference board on a desk: no rig, readings that a test sets, and what the board answered and logged.
#pragma once

#include <cstring>
#include <vector>

#include "../proofs/world.hpp"

namespace desk {

using proofs::Bytes;
using proofs::World;

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
    Bytes sent;    // the newest
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
    void send(const Bytes& payload) {
        sent = payload;
        const Bytes wire = proofs::wire_of(payload);
        board.receive<rig::NoLock>(wire.data(), wire.size());
        take();
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

inline rig::ReferenceFields widest() {
    rig::ReferenceFields limits = rig::widest<rig::ReferenceFields>();
    limits.choice.watchdog_us = 50000;
    limits.choice.hold_command_e4 = 0;
    return limits;
}

inline std::uint32_t word(const Bytes& frame, std::size_t at) { return rig::Reader(frame.data() + at).u32(); }

}  // namespace desk
