// The board as a shared library with a C interface, for the simulated rig: the same core that runs on
// the device, ticked from outside in virtual time. One thread per board.
#include "../boards/escon.hpp"
#include "../core/board.hpp"
#include "../core/can_segments.hpp"

#include <new>

namespace {

constexpr std::size_t kTransmitCapacity = 65536;

using HostBoard = rig::Board<kTransmitCapacity>;

// the module of the tests: 10 to 90 % duty is -2 to 2 A, 0 to 3.3 V is -2 to 2 A
constexpr rig::EsconWiring kEscon{{0.1, -2.0, 0.9, 2.0}, 1.0, {0.0, -2.0, 3.3, 2.0}, 3.3, 2.0};

HostBoard* board_of(void* handle) { return static_cast<HostBoard*>(handle); }

}  // namespace

extern "C" {

// Returns null when there is no memory.
void* rig_board_create(const char* serial) { return new (std::nothrow) HostBoard(serial); }

void rig_board_destroy(void* board) { delete board_of(board); }

void rig_board_receive(void* board, const std::uint8_t* data, std::size_t size) {
    board_of(board)->receive(data, size);
}

// inputs: motor, spindle, jaw, proximal, distal, current, fsr counts; outputs: command_e4, load_ma.
void rig_board_tick(void* board, std::uint32_t tick_us, const std::int32_t* inputs,
                    std::int32_t* outputs) {
    rig::Inputs sampled;
    sampled.motor = inputs[0];
    sampled.spindle = inputs[1];
    sampled.jaw = inputs[2];
    sampled.proximal = inputs[3];
    sampled.distal = inputs[4];
    sampled.current = inputs[5];
    sampled.fsr = inputs[6];
    const rig::Outputs given = board_of(board)->tick(tick_us, sampled);
    outputs[0] = given.command_e4;
    outputs[1] = given.load_ma;
}

// Cuts the frames in `wire` into CAN frames: a length byte and 8 bytes each; returns how many.
std::size_t rig_can_split(const std::uint8_t* wire, std::size_t size, std::uint8_t* out,
                          std::size_t room) {
    rig::CanSplitter splitter;
    std::size_t count = 0;
    for (std::size_t i = 0; i < size; ++i) {
        splitter.take(wire[i], [&](const std::uint8_t* data, std::size_t length) {
            if (9 * (count + 1) > room) return;
            out[9 * count] = static_cast<std::uint8_t>(length);
            for (std::size_t k = 0; k < length; ++k) out[9 * count + 1 + k] = data[k];
            ++count;
        });
    }
    return count;
}

// Puts such CAN frames together; returns the bytes of the serial line written to `out`.
std::size_t rig_can_join(const std::uint8_t* frames, std::size_t count, std::uint8_t* out,
                         std::size_t room) {
    rig::CanJoiner joiner;
    std::size_t used = 0;
    for (std::size_t i = 0; i < count; ++i) {
        joiner.take(frames + 9 * i + 1, frames[9 * i],
                    [&](const std::uint8_t* data, std::size_t length) {
                        for (std::size_t k = 0; k < length && used < room; ++k) out[used++] = data[k];
                    });
    }
    return used;
}

std::int32_t rig_escon_code(double current_a) { return kEscon.code(current_a); }
std::int32_t rig_escon_milliampere(std::int32_t reading) { return kEscon.milliampere(reading); }

// CRC-32 of the sources the core was built from.
std::uint32_t rig_board_build_hash() { return rig::kBuildHash; }

// Writes at most `room` waiting bytes to `out`; returns how many.
std::size_t rig_board_transmit(void* board, std::uint8_t* out, std::size_t room) {
    return board_of(board)->transmit(out, room);
}

}  // extern "C"
