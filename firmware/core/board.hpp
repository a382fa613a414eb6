// The logger board without its hardware: bytes and sampled inputs in, commands and bytes out. A board
// layer calls `receive` with what came from the host, `tick` once every Profile::kTickUs, and `transmit`
// when the host can take bytes.
//
// Profile says what is sampled and moved (profile_reference.hpp, profile_grasper.hpp): its Inputs,
// Setpoint and Outputs, the frames that carry them, its limits and its controllers. Everything else, from
// framing to watchdog, session, latches and safe state, is here and the same for all.
//
// `receive` runs in the main loop, `tick` may interrupt it. Frames are decoded and encoded outside the Lock
// that keeps the tick out; inside it only what both touch is changed.
#pragma once

#include <cstddef>
#include <cstdint>

#include "crossing.hpp"
#include "framing.hpp"
#include "limits.hpp"
#include "protocol.hpp"
#include "reference_point.hpp"
#include "session.hpp"
#include "setpoint_queue.hpp"
#include "watchdog.hpp"

namespace rig {

struct NoLock {};

template <class Profile, std::size_t TransmitCapacity>
class Board {
  public:
    using Inputs = typename Profile::Inputs;
    using Setpoint = typename Profile::Setpoint;
    using Settings = typename Profile::Settings;
    using Outputs = typename Profile::Outputs;

    explicit Board(const char* serial) {
        for (std::size_t i = 0; i < kSerialSize && serial[i] != '\0'; ++i) {
            serial_[i] = static_cast<std::uint8_t>(serial[i]);
        }
    }

    // The number of this start, by which a host detects a restart; and whether the rig is a simulated one: its
    // counts already have their zeros and its motors are cold.
    void booted(std::uint32_t boot, bool simulated) {
        boot_ = boot;
        session_.booted(boot);
        status_ = simulated ? kReferenced : 0;
        if (!simulated) assume_hot();
    }

    // Nothing is known of what the motors did before.
    void assume_hot() { profile_.assume_hot(); }

    // The widest settings this board takes; no frame changes them.
    void limit_to(const Settings& own) { own_ = own; }

    template <class Lock>
    void receive(const std::uint8_t* data, std::size_t size) {
        for (std::size_t i = 0; i < size; ++i) {
            if (receiver_.take(data[i]) && receiver_.size() >= kHeaderSize) {
                answer<Lock>(receiver_.payload(), receiver_.size());
            }
        }
    }

    std::size_t transmit(std::uint8_t* out, std::size_t room) {
        return transmitter_.take(out, room);
    }

    // Whether motors are, or may at any tick be, given current.
    bool in_force() const { return armed() || holding(); }

    // What it has tripped over, until that is cleared.
    Trip trip() const { return first_.code; }

    // A trip from before this start, where somebody else has kept it: it is to be cleared here as well.
    void restore(Trip code) {
        if (code == kNoTrip) return;
        first_.code = code;
        status_ = static_cast<std::uint16_t>((status_ & kReferenced) | latched(code));
    }

    // Ticks that were not run: their samples are lost and their setpoints played.
    void skip(std::uint32_t ticks) {
        sequence_ += ticks;
        for (std::uint32_t k = 0; k < ticks && armed() && !queue_.empty(); ++k) play();
    }

    // `stopped` while somebody asks for an emergency stop, or the wire that would carry it is broken.
    Outputs tick(std::uint32_t tick_us, Inputs inputs, bool stopped = false) {
        const std::uint32_t since_us = tick_us - now_us_;
        const std::int64_t ticks = (since_us + Profile::kTickUs / 2) / Profile::kTickUs;
        now_us_ = tick_us;
        stopped_ = stopped;
        reference_.apply(inputs);
        if (ticks > 1) profile_.late(inputs, ticks);
        profile_.warm(inputs, ticks > 1 ? ticks : 1);
        look(inputs);
        const bool dry = armed() && queue_.empty();
        if (armed() && !queue_.empty()) play();
        dry_ticks_ = dry && engaged_ ? dry_ticks_ + 1 : 0;
        const Outputs outputs = engaged_ || holding() ? profile_.drive(held_, inputs) : Outputs();
        if (streaming_) log(tick_us, inputs, outputs, dry);
        return outputs;
    }

  private:
    bool armed() const { return (status_ & kArmed) != 0; }
    bool holding() const { return (status_ & kHolding) != 0; }

    void play() {
        held_ = queue_.pop();
        engaged_ = true;
    }

    // All that takes the motors out of force.
    void look(const Inputs& inputs) {
        const ChoiceFields& choice = profile_.choice();
        const std::uint32_t silent_us = watchdog_.silent_us(now_us_);
        const std::int64_t patience_us = choice.watchdog_us;
        if (stopped_ && (in_force() || first_.code == kNoTrip)) {
            trip({kEmergencyStop, kNoChannel, 1, 0, 0}, inputs);
        }
        if (armed() && silent_us > patience_us) {
            trip({kHostSilent, kNoChannel, silent_us, patience_us, silent_us}, inputs);
        }
        if (armed() && dry_ticks_ >= choice.dry_ticks) {
            const std::int64_t dry_us = dry_ticks_ * Profile::kTickUs;
            trip({kQueueRanDry, kNoChannel, dry_ticks_, choice.dry_ticks, dry_us}, inputs);
        }
        if (holding() && ++held_ticks_ > choice.hold_ticks) release();
        if (in_force()) {
            const Crossing crossing = profile_.check(inputs);
            if (crossing.code != kNoTrip) trip(crossing, inputs);
        }
        if (armed() && !engaged_ && !queue_.empty()) {
            const Crossing leap = profile_.leap(queue_.oldest(), inputs);
            if (leap.code != kNoTrip) trip(leap, inputs);
        }
    }

    static unsigned latched(Trip code) {
        const unsigned kind = code == kHostSilent ? kWatchdogTripped : kLimitTripped;
        return static_cast<unsigned>(code) << kTripShift | kind;
    }

    // Goes to the safe state; the first cause stays.
    void trip(const Crossing& crossing, const Inputs& inputs) {
        const bool holdable = crossing.code == kHostSilent || crossing.code == kStalled ||
                              crossing.code == kSensorSaturated ||
                              crossing.code == kSensorStale || crossing.code == kQueueRanDry;
        const bool hold = holdable && profile_.choice().safe_state == kHold && armed() &&
                          (engaged_ || !queue_.empty());
        release();
        unsigned status = status_;
        if (first_.code == kNoTrip) {
            first_ = crossing;
            first_us_ = now_us_;
            status |= latched(crossing.code);
        }
        const bool doubtful = crossing.code == kEncodersDisagree || crossing.code == kEncoderJump ||
                              crossing.code == kEncoderFrozen;
        if (doubtful) {
            status &= ~static_cast<unsigned>(kReferenced);
            reference_.forget_index();
        }
        if (hold) {
            status |= kHolding;
            held_ticks_ = 0;
            held_ = profile_.begin_to_hold(inputs);
        }
        status_ = static_cast<std::uint16_t>(status);
    }

    // Takes the motors out of force, ends the session and forgets what was to be done; the latches stay.
    void release() {
        status_ = status_ & (kReferenced | kWatchdogTripped | kLimitTripped | 0xFF << kTripShift);
        queue_.clear();
        session_.end();
        engaged_ = false;
        dry_ticks_ = 0;
    }

    // Carries out one command and queues its answer.
    template <class Lock>
    void answer(const std::uint8_t* payload, std::size_t size) {
        Result fault = fault_of(payload, size);
        const bool sound = fault == kOk;
        if (sound && payload[1] == kSetpoints) fault = decode_setpoints(payload, size);
        if (sound && payload[1] == kArm) fault = decode_arm(payload);
        Writer reply;
        {
            [[maybe_unused]] const Lock lock;
            reply = act(payload, sound, fault);
        }
        const Frame frame(reply.bytes(), reply.size());
        [[maybe_unused]] const Lock lock;
        transmitter_.send(frame);
    }

    static Result fault_of(const std::uint8_t* payload, std::size_t size) {
        if (payload[0] != kVersion) return kWrongVersion;
        const std::size_t body = size - kHeaderSize;
        const std::size_t behind = size - kSessionSize;  // of a frame with a session
        const bool has_session = size >= kSessionSize;
        bool fits = body == 0;
        switch (payload[1]) {
            case kHello:
            case kStart:
            case kStop:
            case kDisarm:
            case kTrip:
                break;
            case kClear:
                fits = body == 1;
                break;
            case kReference:
                fits = body == kReferenceSize;
                break;
            case kPing:
                fits = has_session && behind == kTokenSize;
                break;
            case kArm:
                fits = has_session && behind == Profile::kArmSize;
                break;
            case kSetpoints:
                fits = has_session && behind > 0 && behind % Profile::kSetpointSize == 0 &&
                       behind / Profile::kSetpointSize <= Profile::kMaxSetpoints;
                break;
            default:
                return kUnknownKind;
        }
        return fits ? kOk : kWrongSize;
    }

    Result decode_setpoints(const std::uint8_t* payload, std::size_t size) {
        staged_count_ = (size - kSessionSize) / Profile::kSetpointSize;
        Reader reader(payload + kSessionSize);
        bool allowed = true;
        bool slow = true;
        for (std::size_t i = 0; i < staged_count_; ++i) {
            staged_[i] = Setpoint::read(reader);
            allowed = allowed && profile_.allow(staged_[i]);
            slow = slow && (i == 0 || profile_.follows(staged_[i], staged_[i - 1]));
        }
        if (!allowed) return kBadValue;
        return slow ? kOk : kTooFast;
    }

    Result decode_arm(const std::uint8_t* payload) {
        Reader reader(payload + kSessionSize);
        asked_.read(reader);
        if (!asked_.valid()) return kBadValue;
        return asked_.within(own_) ? kOk : kBeyondBoard;
    }

    // Under the lock: what a command changes, and its answer.
    Writer act(const std::uint8_t* payload, bool sound, Result fault) {
        const std::uint8_t kind = payload[1];
        Reader reader(payload + 2);
        const std::uint16_t sequence = reader.u16();
        if (!sound) return acknowledgement(kind, sequence, fault);
        if (kind == kHello) {
            has_last_ = false;  // another program, whose numbers begin anew
            return hello_reply(sequence);
        }
        if (kind == kPing) return pong(reader, sequence);
        if (kind == kTrip) return trip_report(sequence);
        if (has_last_ && kind == last_kind_ && sequence == last_sequence_) {
            return acknowledgement(kind, sequence, last_result_);  // a repeat: its answer was lost
        }
        const Result result = execute(kind, sequence, reader, fault);
        if (kind == kArm || kind == kStart || kind == kSetpoints) {
            has_last_ = true;
            last_kind_ = kind;
            last_sequence_ = sequence;
            last_result_ = result;
        }
        return acknowledgement(kind, sequence, result);
    }

    Result execute(std::uint8_t kind, std::uint16_t sequence, Reader& reader, Result fault) {
        switch (kind) {
            case kArm:
                return arm(reader.u32(), sequence, fault);
            case kSetpoints:
                return take_setpoints(reader.u32(), sequence, fault);
            case kReference:
                return reference(reader);
            case kClear:
                return clear(reader.u8());
            case kStart:
                sequence_ = 0;
                streaming_ = true;
                return kOk;
            case kStop:
                streaming_ = false;
                return kOk;
            default:  // disarm: every other kind was refused
                release();
                has_last_ = false;
                return kOk;
        }
    }

    Result reference(Reader& reader) {
        if (in_force() || !reference_.at_rest()) return kNotAtRest;
        std::int32_t counts[kEncoders];
        for (std::int32_t& count : counts) count = reader.i32();
        const std::uint8_t at_index = reader.u8();
        if (at_index > 1) return kBadValue;
        if (at_index == 0) reference_.set(counts);
        if (at_index == 1 && !reference_.set_at_index(counts)) return kNoIndex;
        status_ |= kReferenced;
        return kOk;
    }

    // Whoever clears a trip names it: what tripped since is not cleared unread.
    Result clear(std::uint8_t code) {
        if (armed()) return kAlreadyArmed;
        if (code != first_.code) return kWrongTrip;
        release();
        first_ = Crossing();
        first_us_ = 0;
        status_ &= kReferenced;
        return kOk;
    }

    Result arm(std::uint32_t session, std::uint16_t sequence, Result fault) {
        if (!session_.attempt(session)) return kWrongSession;
        if (first_.code != kNoTrip || stopped_) return kTripped;
        if (armed()) return kAlreadyArmed;
        if ((status_ & kReferenced) == 0 && !asked_.seeks()) return kNotReferenced;
        if (fault != kOk) return fault;
        if (profile_.too_hot(asked_)) return kTooHot;
        release();
        profile_.begin(asked_);
        session_.begin(session, sequence);
        watchdog_.heard();
        status_ = static_cast<std::uint16_t>(asked_.seeks() ? kArmed : kArmed | kReferenced);
        return kOk;
    }

    Result take_setpoints(std::uint32_t session, std::uint16_t sequence, Result fault) {
        if (!armed()) return kNotArmed;
        if (!session_.is(session)) return kWrongSession;
        if (!session_.is_new(sequence)) return kOldSequence;
        if (fault != kOk) return fault;
        const bool first = queue_.empty() && !engaged_;
        const Setpoint& before = queue_.empty() ? held_ : queue_.newest();
        if (!first && !profile_.follows(staged_[0], before)) return kTooFast;
        if (staged_count_ > queue_.free()) return kQueueFull;
        queue_.push(staged_, staged_count_);
        session_.take(sequence);
        watchdog_.heard();
        return kOk;
    }

    Writer hello_reply(std::uint16_t sequence) {
        Writer reply = begin(kHelloReply, sequence);
        reply.u32(Profile::kProtocolHash).u32(kFirmwareVersion).u32(kBuildHash);
        for (std::uint8_t character : serial_) reply.u8(character);
        return reply.u32(boot_).u16(status_).u32(session_.offer());
    }

    // Anybody may ask for the clock; only the session's own pings are a sign of life.
    Writer pong(Reader& reader, std::uint16_t sequence) {
        const std::uint32_t session = reader.u32();
        if (session_.is(session) && session_.is_new(sequence)) {
            session_.take(sequence);
            watchdog_.heard();
        }
        return begin(kPong, sequence).u64(reader.u64()).u32(now_us_);
    }

    Writer trip_report(std::uint16_t sequence) const {
        const std::int64_t most_late_us = UINT32_MAX;
        const std::int64_t late_us = first_.late_us < most_late_us ? first_.late_us : most_late_us;
        return begin(kTripReport, sequence)
            .u8(first_.code)
            .u8(first_.channel)
            .i32(clip32(first_.value))
            .i32(clip32(first_.limit))
            .u32(first_us_)
            .u32(static_cast<std::uint32_t>(late_us));
    }

    Writer acknowledgement(std::uint8_t command, std::uint16_t sequence, Result result) const {
        return begin(kAck, sequence)
            .u8(command)
            .u8(result)
            .u16(status_)
            .u16(static_cast<std::uint16_t>(queue_.free()));
    }

    void log(std::uint32_t tick_us, const Inputs& inputs, const Outputs& outputs, bool dry) {
        unsigned status = status_;
        if (profile_.saturated(inputs)) status |= kSaturated;
        if (dry) status |= kQueueDry;
        Writer sample;
        sample.u8(kVersion).u8(kSample).u16(static_cast<std::uint16_t>(status));
        sample.u32(sequence_++).u32(tick_us);
        const bool asked = engaged_ || holding();
        Profile::write(sample, inputs, asked ? held_ : Profile::resting(inputs), outputs);
        sample.u16(transmitter_.dropped());
        transmitter_.send(Frame(sample.bytes(), sample.size()));
    }

    static Writer begin(Kind kind, std::uint16_t sequence) {
        Writer writer;
        writer.u8(kVersion).u8(kind).u16(sequence);
        return writer;
    }

    std::uint8_t serial_[kSerialSize] = {};
    FrameReceiver receiver_;
    FrameTransmitter<TransmitCapacity> transmitter_;
    SetpointQueue<Setpoint, kQueueCapacity> queue_;
    Settings own_ = Settings::widest();
    Settings asked_;                           // of the arm command that is being decoded
    Setpoint staged_[Profile::kMaxSetpoints];  // of the block that is being decoded
    std::size_t staged_count_ = 0;
    Profile profile_;
    ReferencePoint<Profile> reference_;
    Session session_;
    Crossing first_;  // since the board was cleared
    std::uint32_t first_us_ = 0;
    Watchdog watchdog_;
    Setpoint held_;
    std::int64_t dry_ticks_ = 0;
    std::int64_t held_ticks_ = 0;
    std::uint32_t now_us_ = 0;
    std::uint32_t sequence_ = 0;
    std::uint32_t boot_ = 0;
    std::uint16_t status_ = 0;
    bool stopped_ = false;
    bool engaged_ = false;  // armed, and a setpoint has come
    bool streaming_ = false;
    bool has_last_ = false;
    std::uint8_t last_kind_ = 0;
    std::uint16_t last_sequence_ = 0;
    Result last_result_ = kOk;
};

}  // namespace rig
