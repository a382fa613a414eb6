// The three encoders of a Teensy 4.1: three of its four hardware decoders, 32 bits each.
#pragma once

#include <QuadEncoder.h>

#include "encoder_filter41.hpp"
#include "wiring41.hpp"

namespace rig {

class Counters {
  public:
    void begin() {
        for (QuadEncoder* encoder : {&motor_, &spindle_, &jaw_}) {
            filter(*encoder);
            encoder->init();
        }
    }

    std::int32_t motor() { return motor_.read(); }
    std::int32_t spindle() { return spindle_.read(); }
    std::int32_t jaw() { return jaw_.read(); }

  private:
    QuadEncoder motor_{1, wiring::kMotorA, wiring::kMotorB};
    QuadEncoder spindle_{2, wiring::kSpindleA, wiring::kSpindleB};
    QuadEncoder jaw_{3, wiring::kJawA, wiring::kJawB};
};

}  // namespace rig
