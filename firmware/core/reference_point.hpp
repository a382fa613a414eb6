// Where the encoders' zeros are. Incremental counters begin at 0 wherever the shafts stand when the board is
// started; travel limits mean nothing until the host has sent the counts of the present place, or of the place of
// the encoder's index, which the shaft has passed.
#pragma once

#include <cstddef>
#include <cstdint>

#include "crossing.hpp"

namespace rig {

template <class Profile>
class ReferencePoint {
  public:
    // Turns what the counters give into the rig's counts. Once every tick.
    void apply(typename Profile::Inputs& inputs) {
        ++still_ticks_;
        bool whole = true;
        for (std::size_t k = 0; k < kEncoders; ++k) {
            std::int32_t& count = Profile::encoder(inputs, k);
            if (count == kMissing) {
                still_ticks_ = 0;
                whole = false;
                continue;
            }
            if (magnitude(std::int64_t{count} - anchor_[k]) > kRestCounts) {
                anchor_[k] = count;
                still_ticks_ = 0;
            }
            raw_[k] = count;
            count = wrapped(count, offset_[k]);
        }
        if (!whole || !Profile::indexed(inputs)) return;
        for (std::size_t k = 0; k < kEncoders; ++k) index_[k] = raw_[k];
        has_index_ = true;
    }

    bool at_rest() const { return still_ticks_ >= kRestTicks; }

    // From now on the counts of the present place are these.
    void set(const std::int32_t (&counts)[kEncoders]) { set(counts, raw_); }

    // The same for the place where the index came last; false where it has not since it was used or forgotten.
    bool set_at_index(const std::int32_t (&counts)[kEncoders]) {
        if (!has_index_) return false;
        set(counts, index_);
        forget_index();
        return true;
    }
    void forget_index() { has_index_ = false; }

  private:
    static constexpr std::int64_t kRestCounts = 4;
    static constexpr std::uint32_t kRestTicks = 100;

    void set(const std::int32_t (&counts)[kEncoders], const std::int32_t (&place)[kEncoders]) {
        for (std::size_t k = 0; k < kEncoders; ++k) {
            offset_[k] = wrapped(counts[k], wrapped(0, -std::int64_t{place[k]}));
        }
    }

    static std::int32_t wrapped(std::int32_t count, std::int64_t more) {
        return static_cast<std::int32_t>(static_cast<std::uint32_t>(count) +
                                         static_cast<std::uint32_t>(more));
    }

    std::int32_t raw_[kEncoders] = {};
    std::int32_t anchor_[kEncoders] = {};
    std::int32_t index_[kEncoders] = {};
    std::int32_t offset_[kEncoders] = {};
    std::uint32_t still_ticks_ = 0;
    bool has_index_ = false;
};

}  // namespace rig
