// Encoder counts where the hardware gives less than 32 bits of them. No Arduino here, so that it runs
// on any host.
#pragma once

#include <cstdint>

#include "../core/crossing.hpp"

namespace rig {

// A 16-bit hardware counter, extended by looking at it at least every 32767 counts.
class WideCounter {
  public:
    void start(std::uint16_t count) { last_ = count; }

    std::int32_t follow(std::uint16_t count) {
        total_ += static_cast<std::uint32_t>(
            static_cast<std::int32_t>(static_cast<std::int16_t>(count - last_)));
        last_ = count;
        return static_cast<std::int32_t>(total_);
    }

  private:
    std::uint16_t last_ = 0;
    std::uint32_t total_ = 0;  // wraps like the hardware's
};

// A decoder in software: it gets both levels at every edge of either line, by an interrupt.
class EdgeDecoder {
  public:
    void start(bool a, bool b) { state_ = state_of(a, b); }

    void edge(bool a, bool b) {
        // once round is 00, 10, 11, 01; A leads B on the way up
        static constexpr std::int8_t kStep[16] = {0, -1, 1, 2, 1, 0, 2, -1, -1, 2, 0, 1, 2, 1, -1, 0};
        const unsigned now = state_of(a, b);
        const std::int8_t step = kStep[state_ << 2 | now];
        state_ = now;
        if (step == 2) {
            skipped_ = true;
        } else {
            count_ = count_ + step;
        }
    }

    // Missing for good once an edge was skipped: the position of the shaft is then unknown.
    std::int32_t count() const { return skipped_ ? kMissing : count_; }

  private:
    static unsigned state_of(bool a, bool b) { return (a ? 2U : 0U) | (b ? 1U : 0U); }

    volatile unsigned state_ = 0;
    volatile std::int32_t count_ = 0;
    volatile bool skipped_ = false;
};

}  // namespace rig
