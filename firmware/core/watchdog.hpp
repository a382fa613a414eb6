// Says when the host has been silent for too long.
#pragma once

#include <cstdint>

namespace rig {

class Watchdog {
  public:
    void heard() { heard_ = true; }

    // How long the host has been silent, us. To be called every tick; what was heard since the last
    // one counts from now on. The clock may wrap.
    std::uint32_t silent_us(std::uint32_t now_us) {
        if (heard_) {
            last_us_ = now_us;
            heard_ = false;
        }
        return now_us - last_us_;
    }

  private:
    std::uint32_t last_us_ = 0;
    bool heard_ = false;
};

}  // namespace rig
