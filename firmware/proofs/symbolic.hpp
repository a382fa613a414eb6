// What a theorem is written with. Its numbers stand for every number at once: `symbolic.py` runs the compiled
// function on symbols in place of values, and decides each claim for all of them.
#pragma once

#include <cstddef>
#include <cstdint>

extern "C" {
void any_bytes(void* at, std::size_t size);   // bytes that may be anything
void assume(bool holds);                      // from here on only cases in which this holds
void claim(bool holds, const char* what);     // to be shown
int pick(int count);                          // 0 to count - 1, each followed by itself
}

template <class T>
T any() {
    T value;
    any_bytes(&value, sizeof value);
    return value;
}
template <>
inline bool any<bool>() {
    return (any<std::uint8_t>() & 1) != 0;
}

#define THEOREM(name, text)                     \
    extern "C" const char text_##name[] = text; \
    extern "C" void prove_##name()
