// Frames on a byte link: COBS, a CRC-16/CCITT-FALSE at the end, 0x00 between frames.
// The twin of drivers/framing.py. No heap, no exceptions, no Arduino.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rig {

constexpr std::size_t kMaxPayload = 1024;
constexpr std::size_t kCrcSize = 2;
constexpr std::size_t kMaxBody = kMaxPayload + kCrcSize;
constexpr std::size_t kMaxBlock = 254;
// longest frame on the wire, without its delimiter
constexpr std::size_t kMaxWire = kMaxBody + kMaxBody / kMaxBlock + 1;

constexpr std::uint16_t crc16_next(std::uint16_t crc, std::uint8_t byte) {
    // the nibbles of the polynomial 0x1021 folded together: one byte without a table
    auto x = static_cast<std::uint8_t>((crc >> 8) ^ byte);
    x = static_cast<std::uint8_t>(x ^ (x >> 4));
    return static_cast<std::uint16_t>((crc << 8) ^ (x << 12) ^ (x << 5) ^ x);
}

constexpr std::uint16_t crc16(const std::uint8_t* data, std::size_t size) {
    std::uint16_t crc = 0xFFFF;
    for (std::size_t i = 0; i < size; ++i) crc = crc16_next(crc, data[i]);
    return crc;
}

// Stuffs `size` bytes into `out`, which holds at least size + size / 254 + 1; returns the length.
constexpr std::size_t cobs_encode(const std::uint8_t* data, std::size_t size, std::uint8_t* out) {
    std::size_t code_at = 0;
    std::size_t length = 1;
    std::uint8_t code = 1;
    for (std::size_t i = 0; i < size; ++i) {
        if (data[i] != 0) {
            out[length++] = data[i];
            ++code;
        }
        const bool full = code == kMaxBlock + 1;
        if (data[i] == 0 || (full && i + 1 < size)) {  // a full block at the end implies no zero
            out[code_at] = code;
            code_at = length++;
            code = 1;
        }
    }
    out[code_at] = code;
    return length;
}

// Unstuffs in place; returns the length, or -1 when the bytes are not COBS.
constexpr std::ptrdiff_t cobs_decode(std::uint8_t* data, std::size_t size) {
    std::size_t read = 0;
    std::size_t written = 0;
    while (read < size) {
        const std::uint8_t code = data[read];
        if (code == 0 || read + code > size) return -1;
        for (std::size_t i = 1; i < code; ++i) data[written++] = data[read + i];
        read += code;
        if (code <= kMaxBlock && read < size) data[written++] = 0;
    }
    return static_cast<std::ptrdiff_t>(written);
}

// Collects bytes into frames. Loses its place only up to the next delimiter.
class FrameReceiver {
  public:
    // Takes one byte; true when it ends a good frame, which `payload` and `size` then give.
    bool take(std::uint8_t byte) {
        if (byte != 0) {
            if (length_ < kMaxWire) {
                buffer_[length_++] = byte;
            } else {
                overlong_ = true;
            }
            return false;
        }
        const bool good = length_ > 0 && !overlong_ && decode();
        length_ = 0;
        overlong_ = false;
        return good;
    }

    const std::uint8_t* payload() const { return buffer_.data(); }
    std::size_t size() const { return size_; }

  private:
    bool decode() {
        const std::ptrdiff_t body = cobs_decode(buffer_.data(), length_);
        if (body < static_cast<std::ptrdiff_t>(kCrcSize)) return false;
        size_ = static_cast<std::size_t>(body) - kCrcSize;
        const unsigned expected = buffer_[size_] | static_cast<unsigned>(buffer_[size_ + 1]) << 8;
        return crc16(buffer_.data(), size_) == expected;
    }

    std::array<std::uint8_t, kMaxWire> buffer_{};
    std::size_t length_ = 0;
    std::size_t size_ = 0;
    bool overlong_ = false;
};

// A short payload as it goes over the wire, with its delimiter.
struct Frame {
    static constexpr std::size_t kMostPayload = 64;  // more than the longest a board sends

    Frame(const std::uint8_t* payload, std::size_t payload_size) {
        std::uint8_t body[kMostPayload + kCrcSize];
        for (std::size_t i = 0; i < payload_size; ++i) body[i] = payload[i];
        const std::uint16_t crc = crc16(payload, payload_size);
        body[payload_size] = static_cast<std::uint8_t>(crc & 0xFF);
        body[payload_size + 1] = static_cast<std::uint8_t>(crc >> 8);
        size = cobs_encode(body, payload_size + kCrcSize, bytes);
        bytes[size++] = 0;
    }

    std::uint8_t bytes[kMostPayload + kCrcSize + 2];
    std::size_t size;
};

// Bytes that wait for the host, whole frames only: one that does not fit is dropped and counted.
template <std::size_t Capacity>
class FrameTransmitter {
  public:
    void send(const Frame& frame) {
        if (frame.size > Capacity - used_) {
            ++dropped_;
            return;
        }
        std::size_t at = (first_ + used_) % Capacity;
        for (std::size_t i = 0; i < frame.size; ++i) {
            ring_[at] = frame.bytes[i];
            at = at + 1 == Capacity ? 0 : at + 1;
        }
        used_ += frame.size;
    }

    // Gives up to `room` bytes to `out`; returns how many.
    std::size_t take(std::uint8_t* out, std::size_t room) {
        const std::size_t count = room < used_ ? room : used_;
        for (std::size_t i = 0; i < count; ++i) out[i] = ring_[(first_ + i) % Capacity];
        first_ = (first_ + count) % Capacity;
        used_ -= count;
        return count;
    }

    std::uint16_t dropped() const { return dropped_; }

  private:
    std::array<std::uint8_t, Capacity> ring_{};
    std::size_t first_ = 0;
    std::size_t used_ = 0;
    std::uint16_t dropped_ = 0;
};

}  // namespace rig
