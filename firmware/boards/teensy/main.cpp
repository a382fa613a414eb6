// The logger on a Teensy: a timer samples and drives, the loop carries bytes. The profile is chosen by the
// build: the reference rig's, or with -DRIG_GRASPER the grasper's.
#if defined(RIG_GRASPER)
#include "grasper_hardware.hpp"
using Hardware = rig::GrasperHardware;
#else
#include "hardware.hpp"
using Hardware = rig::ReferenceHardware;
#endif

namespace {

constexpr std::size_t kTransmitCapacity = 65536;

Hardware hardware;
rig::App<Hardware::Profile, Hardware, kTransmitCapacity> app(hardware, Hardware::serial(rig::wiring::kSerial));
IntervalTimer timer;

void sample() { app.tick(); }

}  // namespace

void setup() {
    hardware.begin();
    app.begin(Hardware::boot(), rig::wiring::own_limits());
    timer.priority(rig::wiring::kSamplePriority);
    hardware.begin_watch();
    // without a timer no tick feeds the watchdog, and the chip starts anew
    if (!timer.begin(sample, static_cast<int>(Hardware::Profile::kTickUs))) rig::motors_off();
}

void loop() { app.exchange(); }
