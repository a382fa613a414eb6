// Theorems on the core. `python -m benchmarks.core_proofs` decides them, see symbolic.hpp.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>

// a theorem begins in any state that an object can have, so it sees the state
#define private public
#include "../core/board.hpp"
#include "../core/profile_reference.hpp"
#include "any_profile.hpp"
#undef private

namespace {

using proofs::AnyProfile;
using AnyBoard = rig::Board<AnyProfile, 8>;

// What holds between any two calls of a board. Each & in place of && keeps it one expression.
bool is_sound(const AnyBoard& board) {
    const unsigned status = board.status_;
    const unsigned code = board.first_.code;
    const bool armed = (status & rig::kArmed) != 0;
    const bool holding = (status & rig::kHolding) != 0;
    const bool latched = (status & (rig::kWatchdogTripped | rig::kLimitTripped)) != 0;
    const bool tripped = code != rig::kNoTrip;
    const bool engaged = board.engaged_;
    const bool empty = board.queue_.used_ == 0;
    const bool trips = (code <= rig::kEmergencyStop) & (status >> rig::kTripShift == code) &
                       (tripped == latched) & !(armed & tripped) & !(holding & (armed | (!tripped)));
    const bool moves = (armed == board.session_.live_) & (armed | !engaged) & (armed | empty) &
                       (board.queue_.used_ <= rig::kQueueCapacity) &
                       (!engaged | (board.held_.target <= board.profile_.bound));
    const bool counts = (board.dry_ticks_ >= 0) & (board.dry_ticks_ <= INT32_MAX) &
                        (!holding | ((board.held_ticks_ >= 0) & (board.held_ticks_ <= INT32_MAX)));
    return trips & moves & counts;
}

void begin_anywhere(AnyBoard& board) {
    board.booted(any<std::uint32_t>(), true);
    board.session_.offers_ = any<std::uint32_t>();
    board.session_.number_ = any<std::uint32_t>();
    board.session_.newest_ = any<std::uint16_t>();
    board.session_.live_ = any<bool>();
    board.watchdog_.last_us_ = any<std::uint32_t>();
    board.watchdog_.heard_ = any<bool>();
    board.first_.code = static_cast<rig::Trip>(any<std::uint8_t>());
    board.status_ = any<std::uint16_t>();
    board.stopped_ = any<bool>();
    board.engaged_ = any<bool>();
    board.has_last_ = any<bool>();
    board.last_kind_ = any<std::uint8_t>();
    board.last_sequence_ = any<std::uint16_t>();
    board.dry_ticks_ = any<std::int64_t>();
    board.held_ticks_ = any<std::int64_t>();
    board.now_us_ = any<std::uint32_t>();
    board.held_.target = any<std::int32_t>();
    board.queue_.used_ = any<std::size_t>();
    board.queue_.bound_ = &board.profile_.bound;
    board.profile_.bound = any<std::int32_t>();
    board.own_.bound = any<std::int32_t>();
    any_bytes(&board.profile_.chosen, sizeof board.profile_.chosen);
    assume(is_sound(board));
}

bool is_new(std::uint16_t sequence, std::uint16_t newest) {
    const unsigned ahead = (unsigned{sequence} - newest) & 0xFFFFU;
    return (ahead >= 1) & (ahead <= 32767);
}

}  // namespace

THEOREM(board_tick,
        "A tick, in any state, at any time, with any inputs and any answer of the guards: it does not arm; a trip "
        "stays; nothing is driven unless armed or holding; an emergency stop, a silent host and a guard that trips "
        "end the session in this tick; an armed board drives no set point that was not allowed.") {
    AnyBoard board("");
    begin_anywhere(board);
    const auto code = board.first_.code;
    const bool was_armed = board.armed();
    const auto now_us = any<std::uint32_t>();
    const bool stopped = any<bool>();
    const std::uint32_t silent_us = board.watchdog_.heard_ ? 0 : now_us - board.watchdog_.last_us_;
    AnyProfile::Inputs inputs;
    any_bytes(&inputs, sizeof inputs);
    const auto outputs = board.tick(now_us, inputs, stopped);
    claim(is_sound(board), "the state stays sound");
    claim(!board.armed() || was_armed, "a tick does not arm");
    if (code != rig::kNoTrip) claim(board.first_.code == code, "a trip stays");
    if (outputs.in_force) claim(board.in_force(), "nothing is driven unless armed or holding");
    if (stopped) claim(!board.in_force(), "an emergency stop ends everything");
    if (was_armed && std::int64_t{silent_us} > board.profile_.chosen.watchdog_us) {
        claim(!board.armed(), "a silent host ends the session");
    }
    if (board.profile_.crosses) claim(!board.armed(), "a guard that trips ends the session");
    if (outputs.in_force && board.armed()) {
        claim(outputs.command <= board.profile_.bound, "only allowed set points are driven");
    }
}

THEOREM(board_command,
        "A command of any 4 to 24 bytes, in any state: a trip goes by a clear command with its code and by nothing "
        "else; only an arm command with the offered number arms, which spends it, over no trip, with the emergency "
        "stop released, within the board's limits; the host's time is fed and set points are queued by frames of the "
        "session that armed alone, with a rising number; no more are queued than fit, and none that is not allowed.") {
    AnyBoard board("");
    begin_anywhere(board);
    std::uint8_t payload[24];
    any_bytes(payload, sizeof payload);
    const auto size = any<std::size_t>();
    assume((size >= rig::kHeaderSize) & (size <= sizeof payload));
    const auto code = board.first_.code;
    const bool was_armed = board.armed();
    const bool heard = board.watchdog_.heard_;
    const auto offer = board.session_.offer();
    const auto session = board.session_;
    const auto used = board.queue_.used_;
    const std::uint8_t kind = payload[1];
    const auto sequence = static_cast<std::uint16_t>(payload[2] | payload[3] << 8);
    std::uint32_t number;
    std::memcpy(&number, payload + rig::kHeaderSize, sizeof number);
    board.answer<rig::NoLock>(payload, size);
    claim(is_sound(board), "the state stays sound");
    if (board.first_.code != code) {
        claim((kind == rig::kClear) & (payload[4] == code) & (size == 5), "a trip goes by its own code");
        claim(board.first_.code == rig::kNoTrip, "no command trips");
    }
    if (board.armed() && !was_armed) {
        claim((kind == rig::kArm) & (number == offer) & (size == 12), "armed with the offered number");
        claim(board.session_.offers_ == session.offers_ + 1U, "which is spent");
        claim((code == rig::kNoTrip) & !board.stopped_, "over no trip and no emergency stop");
        claim((board.profile_.bound <= board.own_.bound) & (board.profile_.bound >= 0), "within its limits");
    }
    const bool of_session = (number == session.number_) & is_new(sequence, session.newest_);
    if (was_armed && board.watchdog_.heard_ && !heard) {
        claim(of_session & ((kind == rig::kPing) | (kind == rig::kSetpoints)), "fed by its session");
    }
    if (board.queue_.used_ > used) {
        claim(was_armed & of_session & (kind == rig::kSetpoints), "set points of its session");
    }
}

THEOREM(crc_step, "One step of the CRC, from any value with any byte, is that of its definition bit by bit.") {
    const auto crc = any<std::uint16_t>();
    const auto byte = any<std::uint8_t>();
    unsigned slow = crc ^ static_cast<unsigned>(byte) << 8;
    for (int bit = 0; bit < 8; ++bit) {
        const unsigned carry = 0U - (slow >> 15 & 1U);
        slow = (slow << 1 ^ (carry & 0x1021U)) & 0xFFFFU;
    }
    claim(rig::crc16_next(crc, byte) == slow, "equal");
}

THEOREM(cobs_round_trip, "Any string of up to 5 bytes: its code has no zero and one byte more, and gives it back.") {
    const auto size = static_cast<std::size_t>(pick(6));
    std::uint8_t data[5];
    std::uint8_t wire[8];
    any_bytes(data, sizeof data);
    const std::size_t length = rig::cobs_encode(data, size, wire);
    claim(length == size + 1, "one byte more");
    for (std::size_t k = 0; k < length; ++k) claim(wire[k] != 0, "no zero");
    claim(rig::cobs_decode(wire, length) == static_cast<std::ptrdiff_t>(size), "its length comes back");
    for (std::size_t k = 0; k < size; ++k) claim(wire[k] == data[k], "it comes back");
}

THEOREM(cobs_anything, "Decoding any string of up to 6 bytes gives no more than it took, or refuses it.") {
    const auto size = static_cast<std::size_t>(pick(7));
    std::uint8_t data[6];
    any_bytes(data, sizeof data);
    const std::ptrdiff_t length = rig::cobs_decode(data, size);
    claim((length >= -1) & (length <= static_cast<std::ptrdiff_t>(size)), "no longer");
}

THEOREM(receiver_byte, "A byte of a frame, with any number received before: it is kept in the buffer or dropped.") {
    rig::FrameReceiver frames;
    frames.length_ = any<std::size_t>();
    frames.overlong_ = any<bool>();
    const auto byte = any<std::uint8_t>();
    assume((frames.length_ <= rig::kMaxWire) & (byte != 0));
    const auto before = frames.length_;
    const bool whole = frames.take(byte);
    claim(!whole & (frames.length_ <= rig::kMaxWire) & (frames.length_ - before <= 1), "within its buffer");
    claim((frames.length_ > before) | frames.overlong_, "a dropped byte is marked");
}

THEOREM(sequence_window, "Every pair of numbers: new means 1 to 32767 ahead; what was taken and all before is old.") {
    rig::Session session;
    const auto newest = any<std::uint16_t>();
    const auto sequence = any<std::uint16_t>();
    session.newest_ = newest;
    claim(session.is_new(sequence) == is_new(sequence, newest), "the window");
    assume(is_new(sequence, newest));
    session.take(sequence);
    claim(!session.is_new(sequence) & !session.is_new(newest), "neither it nor the one before comes twice");
}

THEOREM(queue_step, "A queue of 4, in any of its states: push, pop and clear keep order, number and contents.") {
    rig::SetpointQueue<std::int32_t, 4> queue;
    any_bytes(queue.ring_.data(), sizeof queue.ring_);
    queue.first_ = static_cast<std::size_t>(pick(4));
    queue.used_ = static_cast<std::size_t>(pick(5));
    std::int32_t model[8];
    const std::size_t used = queue.used_;
    for (std::size_t k = 0; k < used; ++k) model[k] = queue.ring_[(queue.first_ + k) % 4];
    if (used > 0) claim((queue.oldest() == model[0]) & (queue.newest() == model[used - 1]), "its ends");
    std::int32_t more[4];
    any_bytes(more, sizeof more);
    const auto count = static_cast<std::size_t>(pick(5));
    if (count <= queue.free()) {
        queue.push(more, count);
        for (std::size_t k = 0; k < count; ++k) model[used + k] = more[k];
        claim(queue.free() == 4 - used - count, "its room");
        for (std::size_t k = 0; k < used + count; ++k) claim(queue.pop() == model[k], "in order");
        claim(queue.empty(), "nothing is left");
    }
    queue.clear();
    claim(queue.empty() & (queue.free() == 4), "cleared");
}

THEOREM(watchdog_steps, "Any three ticks of a watchdog, over the clock's wrap: silence counts from the tick that heard.") {
    rig::Watchdog watchdog;
    watchdog.last_us_ = any<std::uint32_t>();
    std::uint32_t heard_us = watchdog.last_us_;
    for (int k = 0; k < 3; ++k) {
        const auto now_us = any<std::uint32_t>();
        if (pick(2) == 1) {
            watchdog.heard();
            heard_us = now_us;
        }
        claim(watchdog.silent_us(now_us) == now_us - heard_us, "the silence");
    }
}

THEOREM(heat_step,
        "The heat of a winding, from any heat: currents of 0, 1, 2000, the most and none, over 1, 2 and the most ticks, "
        "with continuous currents of 0, 1, 3000 and the most: nothing overflows, it stays in its range, and it falls "
        "exactly where the current is smaller.") {
    const std::int32_t current_each[6] = {0, 1, -2000, INT32_MAX, -INT32_MAX, rig::kMissing};
    const std::int64_t continuous_each[4] = {0, 1, 3000, INT32_MAX};
    const std::int64_t ticks_each[3] = {1, 2, UINT32_MAX};
    rig::Heat heat;
    const auto before = any<std::int64_t>();
    heat.heat_ = before;
    heat.hot_ticks_ = any<std::int64_t>();
    heat.unknown_ticks_ = any<std::int64_t>();
    assume((before >= 0) & (before <= rig::Heat::kHottest) & (heat.hot_ticks_ >= 0) &
           (heat.hot_ticks_ < std::int64_t{1} << 50) & (heat.unknown_ticks_ >= -1) &
           (heat.unknown_ticks_ <= rig::Heat::kLongestTicks));
    const std::int32_t current = current_each[pick(6)];
    const std::int64_t continuous = continuous_each[pick(4)];
    heat.take(continuous, 1000, ticks_each[pick(3)], current);
    claim((heat.heat_ >= 0) & (heat.heat_ <= rig::Heat::kHottest), "in its range");
    const std::int64_t size = current == rig::kMissing ? 0 : rig::magnitude(current);
    const bool smaller = std::min(size, rig::Heat::kLargest) < std::min(continuous, rig::Heat::kLargest);
    claim((heat.heat_ < before) == (smaller & (before > 0)), "it falls where the current is smaller");
}

THEOREM(heat_limit, "Any heat, any limit but none: a winding trips exactly above its limit.") {
    rig::Heat heat;
    heat.heat_ = any<std::int64_t>();
    heat.hot_ticks_ = any<std::int64_t>();
    const auto most = any<std::int32_t>();
    assume((heat.heat_ >= 0) & (heat.heat_ <= rig::Heat::kHottest) & (most >= 0) & (most != INT32_MAX) &
           (heat.hot_ticks_ >= 0) & (heat.hot_ticks_ < std::int64_t{1} << 50));
    const bool trips = heat.check(most, 1000, 5).code == rig::kOverheated;
    claim(trips == (heat.heat_ > std::int64_t{most} * 1000), "above its limit");
}

THEOREM(limits_within, "Any asked limits, any limits of the board: what is within asks for no more in any respect.") {
    rig::ReferenceFields asked;
    rig::ReferenceFields own;
    any_bytes(&asked, sizeof asked);
    any_bytes(&own, sizeof own);
    assume(rig::within(asked, own));
    claim((asked.max_current <= own.max_current) & (asked.max_load_ma <= own.max_load_ma), "currents");
    claim((asked.max_proximal <= own.max_proximal) & (asked.max_distal <= own.max_distal), "torques");
    claim((asked.min_spindle >= own.min_spindle) & (asked.max_spindle <= own.max_spindle), "spindle");
    claim((asked.min_jaw >= own.min_jaw) & (asked.max_jaw <= own.max_jaw), "jaw");
    claim((asked.motor.max_motor_step <= own.motor.max_motor_step) & (asked.motor.i2t <= own.motor.i2t), "motor");
    claim(asked.choice.watchdog_us <= own.choice.watchdog_us, "watchdog");
    claim(asked.choice.hold_command_e4 <= own.choice.hold_command_e4, "hold");
    claim((asked.loop.max_following <= own.loop.max_following) & (asked.max_beyond <= own.max_beyond), "travel");
}

THEOREM(setpoint_allowed, "Any set point, any limits: an allowed one is within load current and travel.") {
    rig::ReferenceProfile profile;
    any_bytes(&profile.limits_, sizeof profile.limits_);
    rig::ReferenceProfile::Setpoint setpoint;
    setpoint.target = any<std::int32_t>();
    setpoint.load_ma = any<std::int16_t>();
    const auto& limits = profile.limits_;
    assume(limits.max_load_ma >= 0);  // as in all valid limits
    assume(profile.allow(setpoint));
    claim((setpoint.load_ma <= limits.max_load_ma) & (setpoint.load_ma >= -limits.max_load_ma), "load");
    claim((setpoint.target >= limits.min_spindle) & (setpoint.target <= limits.max_spindle), "travel");
}

THEOREM(levels_trip, "Any inputs, any limits: a missing sensor, a current, a torque or a travel beyond its limit trips.") {
    rig::ReferenceProfile profile;
    any_bytes(&profile.limits_, sizeof profile.limits_);
    rig::ReferenceProfile::Inputs now;
    now.motor = any<std::int32_t>();
    now.spindle = any<std::int32_t>();
    now.jaw = any<std::int32_t>();
    now.proximal = any<std::int32_t>();
    now.distal = any<std::int32_t>();
    now.current = any<std::int32_t>();
    const auto& limits = profile.limits_;
    const bool missing = (now.motor == rig::kMissing) | (now.spindle == rig::kMissing) |
                         (now.jaw == rig::kMissing) | (now.proximal == rig::kMissing) |
                         (now.distal == rig::kMissing) | (now.current == rig::kMissing);
    const bool strong = (rig::magnitude(now.current) > limits.max_current) |
                        (rig::magnitude(now.proximal) > limits.max_proximal) |
                        (rig::magnitude(now.distal) > limits.max_distal);
    const bool far = (now.spindle < limits.min_spindle) | (now.spindle > limits.max_spindle) |
                     (now.jaw < limits.min_jaw) | (now.jaw > limits.max_jaw);
    assume(missing | strong | far);
    claim(profile.check(now).code != rig::kNoTrip, "it trips");
}

THEOREM(command_limit, "Any number that is one, any limit of a controller: its command is no larger than the limit.") {
    rig::Controller controller;
    controller.gains_.limit = any<double>();
    const auto command = any<double>();
    assume(command == command);
    assume(controller.gains_.limit >= 0);
    assume(controller.gains_.limit <= rig::kFullScaleE4);
    const double given = controller.within_limit(command);
    claim(given <= controller.gains_.limit, "above");
    claim(given >= -controller.gains_.limit, "below");
}
