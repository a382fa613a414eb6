// What can be done with any set of limits: read it from the wire, judge it, and hold it against the limits
// that the board was built with, which no host can raise.
#pragma once

#include <cstdint>
#include <limits>

#include "protocol.hpp"

namespace rig {

constexpr std::int32_t kHold = 1;

constexpr bool is_upper(Sense sense) {
    return sense == Sense::kMost || sense == Sense::kTicks || sense == Sense::kHighest;
}

template <class Limits>
constexpr Limits widest() {
    Limits limits;
    Limits::each(limits, limits, [](std::int32_t& limit, std::int32_t&, Sense sense) {
        if (is_upper(sense)) limit = INT32_MAX;
        if (sense == Sense::kLeast) limit = INT32_MIN;
    });
    return limits;
}

template <class Limits>
void read(Reader& reader, Limits& limits) {
    Limits::each(limits, limits,
                 [&](std::int32_t& limit, std::int32_t&, Sense) { limit = reader.i32(); });
}

template <class Limits>
bool sizes_are_valid(const Limits& limits) {
    bool valid = true;
    Limits::each(limits, limits, [&](std::int32_t limit, std::int32_t, Sense sense) {
        if (sense == Sense::kMost) valid = valid && limit >= 0;
        if (sense == Sense::kTicks) valid = valid && limit >= 1;
    });
    return valid;
}

// Whether `asked` is at least as strict as `own` in everything; 0 of a fixed number is none.
template <class Limits>
bool within(const Limits& asked, const Limits& own) {
    bool inside = true;
    Limits::each(asked, own, [&](std::int32_t limit, std::int32_t bound, Sense sense) {
        if (is_upper(sense)) inside = inside && limit <= bound;
        if (sense == Sense::kLeast) inside = inside && limit >= bound;
        if (sense == Sense::kFixed) inside = inside && (bound == 0 || limit == bound);
    });
    return inside;
}

inline bool choice_is_valid(const ChoiceFields& choice) {
    return sizes_are_valid(choice) && kMinWatchdogUs <= choice.watchdog_us &&
           choice.watchdog_us <= kMaxWatchdogUs &&
           (choice.safe_state == 0 || choice.safe_state == kHold) &&
           choice.hold_command_e4 <= 10000 && (choice.seek == 0 || choice.seek == 1);
}

}  // namespace rig
