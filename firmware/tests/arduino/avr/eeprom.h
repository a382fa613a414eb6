// Stands for the memory of a Teensy that outlives its power.
#pragma once

#include <cstdint>
#include <map>

inline std::map<const std::uint32_t*, std::uint32_t> eeprom;

inline std::uint32_t eeprom_read_dword(const std::uint32_t* at) {
    return eeprom.count(at) != 0 ? eeprom[at] : 0xFFFFFFFFU;
}
inline void eeprom_write_dword(std::uint32_t* at, std::uint32_t value) { eeprom[at] = value; }
