// Says when the host has been silent for too long.
#pragma once

#include <cstdint>

namespace rig {

class Watchdog {
  public:
    explicit Watchdog(std::uint32_t patience_us) : patience_us_(patience_us) {}

    void heard() { heard_ = true; }

    // To be called every tick; what was heard since the last one counts from now on. The clock may
    // wrap.
    bool expired(std::uint32_t now_us) {
        if (heard_) {
            last_us_ = now_us;
            heard_ = false;
        }
        return now_us - last_us_ > patience_us_;
    }

  private:
    std::uint32_t patience_us_;
    std::uint32_t last_us_ = 0;
    bool heard_ = false;
};

}  // namespace rig
