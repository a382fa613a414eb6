// The logger on a Teensy 3.5 or 4.1: a timer samples and drives once a millisecond, the loop carries bytes.
#include "hardware.hpp"

namespace {

constexpr std::size_t kTransmitCapacity = 65536;

rig::TeensyHardware hardware;
rig::App<rig::TeensyHardware, kTransmitCapacity> app(hardware, rig::wiring::kSerial);
IntervalTimer timer;

void sample() { app.tick(); }

}  // namespace

void setup() {
    hardware.begin();
    timer.priority(rig::wiring::kSamplePriority);
    timer.begin(sample, 1000);
}

void loop() { app.exchange(); }
