// The frames between board and host as numbers on a wire. What is in them is contract.hpp, generated from the
// host's tables; both sides compare the CRC-32 of its text before anything moves.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "contract.hpp"
#include "framing.hpp"

namespace rig {

// CRC-32 of the sources, set by the build
#ifndef RIG_BUILD_HASH
#define RIG_BUILD_HASH 0
#endif
constexpr std::uint32_t kBuildHash = RIG_BUILD_HASH;

constexpr std::size_t kEncoders = 3;  // of every profile
constexpr std::size_t kReferenceSize = 4 * kEncoders + 1;
constexpr std::size_t kTokenSize = 8;

constexpr std::uint32_t crc32(const char* text) {
    std::uint32_t crc = 0xFFFFFFFFU;
    for (; *text != '\0'; ++text) {
        crc ^= static_cast<std::uint8_t>(*text);
        for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
    }
    return ~crc;
}

constexpr std::int32_t clip(std::int32_t value, std::int32_t low, std::int32_t high) {
    if (value < low) return low;
    return value > high ? high : value;
}
constexpr std::int16_t clip16(std::int32_t value) {
    return static_cast<std::int16_t>(clip(value, INT16_MIN, INT16_MAX));
}
constexpr std::uint16_t clip_u16(std::int32_t value) {
    return static_cast<std::uint16_t>(clip(value, 0, UINT16_MAX));
}
constexpr std::int32_t clip32(std::int64_t value) {
    if (value < INT32_MIN) return INT32_MIN;
    return value > INT32_MAX ? INT32_MAX : static_cast<std::int32_t>(value);
}

// Writes little-endian fields one after another.
class Writer {
  public:
    Writer& u8(std::uint8_t value) {
        bytes_[size_++] = value;
        return *this;
    }
    Writer& u16(std::uint16_t value) { return put(value, 2); }
    Writer& i16(std::int16_t value) { return u16(static_cast<std::uint16_t>(value)); }
    Writer& u32(std::uint32_t value) { return put(value, 4); }
    Writer& i32(std::int32_t value) { return u32(static_cast<std::uint32_t>(value)); }
    Writer& u64(std::uint64_t value) { return put(value, 8); }

    const std::uint8_t* bytes() const { return bytes_; }
    std::size_t size() const { return size_; }

  private:
    Writer& put(std::uint64_t value, int count) {
        for (int i = 0; i < count; ++i) bytes_[size_++] = static_cast<std::uint8_t>(value >> 8 * i);
        return *this;
    }

    std::uint8_t bytes_[Frame::kMostPayload];
    std::size_t size_ = 0;
};

// Reads little-endian fields one after another; the caller has checked the size.
class Reader {
  public:
    explicit Reader(const std::uint8_t* bytes) : bytes_(bytes) {}

    std::uint8_t u8() { return static_cast<std::uint8_t>(take(1)); }
    std::uint16_t u16() { return static_cast<std::uint16_t>(take(2)); }
    std::int16_t i16() { return static_cast<std::int16_t>(u16()); }
    std::int32_t i32() { return static_cast<std::int32_t>(take(4)); }
    std::uint32_t u32() { return static_cast<std::uint32_t>(take(4)); }
    std::uint64_t u64() { return take(8); }
    double f64() {
        const std::uint64_t bits = take(8);
        double value = 0;
        static_assert(sizeof value == sizeof bits, "a double has 64 bits");
        std::memcpy(&value, &bits, sizeof value);
        return value;
    }

  private:
    std::uint64_t take(int count) {
        std::uint64_t value = 0;
        for (int i = 0; i < count; ++i) value |= static_cast<std::uint64_t>(*bytes_++) << 8 * i;
        return value;
    }

    const std::uint8_t* bytes_;
};

}  // namespace rig
