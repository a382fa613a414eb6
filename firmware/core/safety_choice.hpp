// What the host chose for every profile: how long each watch lasts, and what a tripped board does.
#pragma once

#include <cstdint>
#include <initializer_list>

#include "protocol.hpp"

namespace rig {

constexpr std::int32_t kHold = 1;

// In the order of the wire, behind a profile's own limits.
struct SafetyChoice {
    std::int32_t stall_ticks = 1;
    std::int32_t saturated_ticks = 1;
    std::int32_t stale_ticks = 1;
    std::int32_t watchdog_us = 0;
    std::int32_t safe_state = 0;  // 0 release, 1 hold
    std::int32_t hold_command_e4 = 0;

    void read(Reader& reader) {
        for (std::int32_t* field : {&stall_ticks, &saturated_ticks, &stale_ticks, &watchdog_us,
                                    &safe_state, &hold_command_e4}) {
            *field = reader.i32();
        }
    }

    bool valid() const {
        for (std::int32_t ticks : {stall_ticks, saturated_ticks, stale_ticks}) {
            if (ticks < 1) return false;
        }
        return kMinWatchdogUs <= watchdog_us && watchdog_us <= kMaxWatchdogUs &&
               (safe_state == 0 || safe_state == kHold) && 0 <= hold_command_e4 &&
               hold_command_e4 <= 10000;
    }
};

}  // namespace rig
