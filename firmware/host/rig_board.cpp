// The board as a shared library with a C interface, for the simulated rig: the same core that runs on
// the device, ticked from outside in virtual time. One thread per board.
#include "../core/board.hpp"

#include <new>

namespace {

constexpr std::size_t kTransmitCapacity = 65536;

using HostBoard = rig::Board<kTransmitCapacity>;

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

// CRC-32 of the sources the core was built from.
std::uint32_t rig_board_build_hash() { return rig::kBuildHash; }

// Writes at most `room` waiting bytes to `out`; returns how many.
std::size_t rig_board_transmit(void* board, std::uint8_t* out, std::size_t room) {
    return board_of(board)->transmit(out, room);
}

}  // extern "C"
