// Frames on a CAN bus: the same payload and CRC as on a serial line, cut into 7-byte pieces, no COBS.
// Byte 0 of every CAN frame: bit 7 the first piece, bit 6 the last, bits 0 to 5 a counter that goes on
// from frame to frame. The twin is drivers/teensy/can_segments.py.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "framing.hpp"

namespace rig {

constexpr std::uint8_t kFirstPiece = 0x80;
constexpr std::uint8_t kLastPiece = 0x40;
constexpr std::uint8_t kPieceCounter = 0x3F;
constexpr std::size_t kPiece = 7;
constexpr std::uint16_t kHostId = 0x690;
constexpr std::uint16_t kBoardId = 0x6A0;

// Takes the bytes a board sends on a serial line and gives CAN frames.
class CanSplitter {
  public:
    // Takes one byte; calls `send(data, size)` for every CAN frame of a body it ends.
    template <class Send>
    void take(std::uint8_t byte, Send&& send) {
        if (byte != 0) {
            if (length_ < wire_.size()) wire_[length_++] = byte;
            return;
        }
        const std::ptrdiff_t body = length_ != 0 ? cobs_decode(wire_.data(), length_) : 0;
        length_ = 0;
        for (std::ptrdiff_t start = 0; start < body; start += kPiece) {
            const bool last = start + static_cast<std::ptrdiff_t>(kPiece) >= body;
            const std::size_t size = last ? static_cast<std::size_t>(body - start) : kPiece;
            std::uint8_t data[kPiece + 1];
            data[0] = static_cast<std::uint8_t>(counter_ | (start == 0 ? kFirstPiece : 0) |
                                                (last ? kLastPiece : 0));
            counter_ = static_cast<std::uint8_t>((counter_ + 1) & kPieceCounter);
            for (std::size_t i = 0; i < size; ++i) {
                data[1 + i] = wire_[static_cast<std::size_t>(start) + i];
            }
            send(data, size + 1);
        }
    }

  private:
    std::array<std::uint8_t, kMaxWire> wire_{};
    std::size_t length_ = 0;
    std::uint8_t counter_ = 0;
};

// Takes CAN frames and gives the bytes of a serial line. What a lost piece leaves is given as it is:
// its CRC fails, and the board asks for nothing.
class CanJoiner {
  public:
    // Takes the data of one CAN frame; calls `receive(bytes, size)` for each body it ends.
    template <class Receive>
    void take(const std::uint8_t* data, std::size_t size, Receive&& receive) {
        if (size == 0) return;
        const std::uint8_t head = data[0];
        const bool in_order = !heard_ || (head & kPieceCounter) == expected_;
        expected_ = static_cast<std::uint8_t>((head + 1) & kPieceCounter);
        heard_ = true;
        if (open_ && ((head & kFirstPiece) != 0 || !in_order)) give(receive);
        if ((head & kFirstPiece) != 0) {
            open_ = true;
            length_ = 0;
        }
        if (!open_) return;
        for (std::size_t i = 1; i < size && length_ < body_.size(); ++i) body_[length_++] = data[i];
        if ((head & kLastPiece) != 0 || length_ == body_.size()) give(receive);
    }

  private:
    template <class Receive>
    void give(Receive&& receive) {
        std::uint8_t wire[kMaxWire + 1];
        std::size_t length = cobs_encode(body_.data(), length_, wire);
        wire[length++] = 0;
        receive(wire, length);
        open_ = false;
        length_ = 0;
    }

    std::array<std::uint8_t, kMaxBody> body_{};
    std::size_t length_ = 0;
    std::uint8_t expected_ = 0;
    bool open_ = false;
    bool heard_ = false;
};

}  // namespace rig
