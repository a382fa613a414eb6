// Decides when the chip's own watchdog is fed: only by a tick that was completed while the main loop turned
// since the tick that fed it last. A chip whose timer, interrupt or main loop hangs is then reset by itself.
#pragma once

namespace rig {

class Liveness {
  public:
    // From the main loop, each time round.
    void turned() { turned_ = true; }

    // At the end of a tick; true where the watchdog is to be fed.
    bool ticked() {
        const bool feed = turned_;
        turned_ = false;
        return feed;
    }

  private:
    volatile bool turned_ = false;  // written by the main loop, read by the interrupt
};

}  // namespace rig
