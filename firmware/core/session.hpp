// Who may move the rig. The board offers a number, a host arms with it, and only frames with that number and with
// rising sequence numbers count from then on. Each number is good for one attempt to arm, so bytes of an earlier
// one, repeated or late, neither arm nor move anything and are no sign of life.
#pragma once

#include <cstdint>

namespace rig {

class Session {
  public:
    void booted(std::uint32_t boot) {
        boot_ = boot;
        offers_ = 0;
    }

    // The number the next arming needs: another one for each of 65536 attempts of each of 65536 starts.
    std::uint32_t offer() const {
        std::uint32_t x = boot_ << 16 | (offers_ & 0xFFFFU);
        x = (x ^ x >> 16) * 0x7FEB352DU;  // a bijection, Wellons' lowbias32
        x = (x ^ x >> 15) * 0x846CA68BU;
        return x ^ x >> 16;
    }

    // Whether an attempt to arm has the offered number; it is spent by that.
    bool attempt(std::uint32_t number) {
        if (number != offer()) return false;
        ++offers_;
        return true;
    }

    void begin(std::uint32_t number, std::uint16_t sequence) {
        number_ = number;
        newest_ = sequence;
        live_ = true;
    }
    void end() { live_ = false; }

    bool is(std::uint32_t number) const { return live_ && number == number_; }

    // Whether a sequence number lies ahead of all that were taken.
    bool is_new(std::uint16_t sequence) const {
        const unsigned ahead = static_cast<std::uint16_t>(sequence - newest_);
        return 0 < ahead && ahead < 0x8000U;
    }
    void take(std::uint16_t sequence) { newest_ = sequence; }

  private:
    std::uint32_t boot_ = 0;
    std::uint32_t offers_ = 0;
    std::uint32_t number_ = 0;
    std::uint16_t newest_ = 0;
    bool live_ = false;
};

}  // namespace rig
