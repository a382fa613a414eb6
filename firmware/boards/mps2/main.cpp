// The logger on an emulated Cortex-M4: start-up, and the loop that ticks as the host asks for it.
#include "hardware.hpp"

extern "C" {

extern std::uint32_t stack_top, data_begin, data_end, data_stored, bss_begin, bss_end;

[[noreturn]] void reset();
[[noreturn]] void stuck() {
    for (;;) {
    }
}

using Handler = void (*)();
__attribute__((section(".vectors"), used)) const Handler vectors[16] = {
    reinterpret_cast<Handler>(&stack_top),
    reset, stuck, stuck, stuck, stuck, stuck, nullptr, nullptr, nullptr, nullptr,
    stuck, stuck, nullptr, stuck, stuck};
}

namespace {

constexpr std::size_t kTransmitCapacity = 65536;
constexpr std::uint32_t kTickUs = static_cast<std::uint32_t>(rig::ReferenceProfile::kTickUs);

rig::Mps2Hardware* hardware() {
    static rig::Mps2Hardware only;
    return &only;
}

[[noreturn]] void run() {
    static rig::App<rig::ReferenceProfile, rig::Mps2Hardware, kTransmitCapacity> app(*hardware(), "MPS2-0001");
    hardware()->begin();
    app.begin(1, decltype(app)::Settings::widest(), true);
    for (std::uint32_t tick_us = 0;;) {
        const std::uint32_t ticks = hardware()->take_turn();
        do app.exchange();
        while (hardware()->has_unread());
        for (std::uint32_t k = 0; k < ticks; ++k, tick_us += kTickUs) {
            app.tick(tick_us);
            app.exchange();
        }
        hardware()->end_turn();
    }
}

}  // namespace

extern "C" void reset() {
    rig::at(0xE000ED88) |= 0xFU << 20;  // the floating-point unit, before anything uses it
    __asm volatile("dsb\n isb");
    const std::uint32_t* from = &data_stored;
    for (std::uint32_t* to = &data_begin; to < &data_end;) *to++ = *from++;
    for (std::uint32_t* to = &bss_begin; to < &bss_end;) *to++ = 0;
    run();
}
