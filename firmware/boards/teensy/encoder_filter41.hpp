// The filter at a decoder's inputs: a level counts after it was the same in 5 samples on end, one every 10 cycles of the
// 150 MHz bus, 0.33 us. Power stages at 50 kHz ring for less; the motor's edges at 400 rad/s are 3.8 us apart.
#pragma once

#include <QuadEncoder.h>

namespace rig {

inline void filter(QuadEncoder& encoder) {
    encoder.setInitConfig();
    encoder.EncConfig.filterCount = 2;  // 3 more than this
    encoder.EncConfig.filterSamplePeriod = 10;
}

}  // namespace rig
