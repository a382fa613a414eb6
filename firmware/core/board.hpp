// The logger board without its hardware: bytes and sampled inputs in, commands and bytes out. A board
// layer calls `receive` with what came from the host, `tick` once every Profile::kTickUs, and `transmit`
// when the host can take bytes. The Python twin is drivers/teensy/fake.py.
//
// Profile says what is sampled and moved (profile_reference.hpp, profile_grasper.hpp): its Inputs,
// Setpoint and Outputs, the frames that carry them, its limits and its controllers. Everything else, from
// framing to watchdog, latches and safe state, is here and the same for all.
#pragma once

#include <cstddef>
#include <cstdint>

#include "crossing.hpp"
#include "framing.hpp"
#include "protocol.hpp"
#include "reference_point.hpp"
#include "safety_choice.hpp"
#include "setpoint_queue.hpp"
#include "watchdog.hpp"

namespace rig {

template <class Profile, std::size_t TransmitCapacity>
class Board {
  public:
    using Inputs = typename Profile::Inputs;
    using Setpoint = typename Profile::Setpoint;
    using Outputs = typename Profile::Outputs;

    explicit Board(const char* serial) {
        for (std::size_t i = 0; i < kSerialSize && serial[i] != '\0'; ++i) {
            serial_[i] = static_cast<std::uint8_t>(serial[i]);
        }
    }

    // The number of this start, by which a host detects a restart; and whether the counts already have
    // their zeros, as those of a simulated rig do.
    void booted(std::uint32_t boot, bool referenced) {
        boot_ = boot;
        status_ = referenced ? kReferenced : 0;
    }

    void receive(const std::uint8_t* data, std::size_t size) {
        for (std::size_t i = 0; i < size; ++i) {
            if (receiver_.take(data[i]) && receiver_.size() >= kHeaderSize) {
                watchdog_.heard();
                answer(receiver_.payload(), receiver_.size());
            }
        }
    }

    std::size_t transmit(std::uint8_t* out, std::size_t room) {
        return transmitter_.take(out, room);
    }

    Outputs tick(std::uint32_t tick_us, Inputs inputs) {
        now_us_ = tick_us;
        reference_.apply(inputs);
        const std::uint32_t silent_us = watchdog_.silent_us(tick_us);
        const std::int64_t patience_us = profile_.choice().watchdog_us;
        if (armed() && silent_us > patience_us) {
            trip({kHostSilent, kNoChannel, silent_us, patience_us, silent_us}, inputs);
        }
        if (armed() || holding()) {
            const Crossing crossing = profile_.check(inputs);
            if (crossing.code != kNoTrip) trip(crossing, inputs);
        }
        const bool dry = armed() && queue_.empty();
        if (armed() && !queue_.empty()) {
            held_ = queue_.pop();
            engaged_ = true;
        }
        const Outputs outputs = engaged_ || holding() ? profile_.drive(held_, inputs) : Outputs();
        if (streaming_) log(tick_us, inputs, outputs, dry);
        return outputs;
    }

  private:
    bool armed() const { return (status_ & kArmed) != 0; }
    bool holding() const { return (status_ & kHolding) != 0; }

    // Goes to the safe state; the first cause stays.
    void trip(const Crossing& crossing, const Inputs& inputs) {
        const bool hold = profile_.choice().safe_state == kHold && armed() &&
                          (engaged_ || !queue_.empty()) &&
                          (crossing.code == kHostSilent || crossing.code == kStalled ||
                           crossing.code == kSensorSaturated || crossing.code == kSensorStale);
        release();
        unsigned status = status_;
        if (first_.code == kNoTrip) {
            first_ = crossing;
            first_us_ = now_us_;
            status |= static_cast<unsigned>(crossing.code) << kTripShift;
            status |= crossing.code == kHostSilent ? kWatchdogTripped : kLimitTripped;
        }
        const bool doubtful = crossing.code == kEncodersDisagree || crossing.code == kEncoderJump ||
                              crossing.code == kEncoderFrozen;
        if (doubtful) status &= ~static_cast<unsigned>(kReferenced);
        if (hold) {
            status |= kHolding;
            held_ = profile_.begin_to_hold(inputs);
        }
        status_ = static_cast<std::uint16_t>(status);
    }

    // Takes the motors out of force and forgets what was to be done; the latches stay.
    void release() {
        status_ = status_ & (kReferenced | kWatchdogTripped | kLimitTripped | 0xFF << kTripShift);
        queue_.clear();
        engaged_ = false;
    }

    // Carries out one command and queues its answer.
    void answer(const std::uint8_t* payload, std::size_t size) {
        Reader header(payload + 2);
        const std::uint8_t kind = payload[1];
        const std::uint16_t sequence = header.u16();
        const Result fault = fault_of(payload, size);
        if (fault != kOk) {
            acknowledge(kind, sequence, fault);
        } else if (kind == kHello) {
            has_last_ = false;
            Writer reply = begin(kHelloReply, sequence);
            reply.u32(Profile::kProtocolHash).u32(kFirmwareVersion).u32(kBuildHash);
            for (std::uint8_t character : serial_) reply.u8(character);
            reply.u32(boot_).u16(status_);
            send(reply);
        } else if (kind == kPing) {
            Reader body(payload + kHeaderSize);
            send(begin(kPong, sequence).u64(body.u64()).u32(now_us_));
        } else if (kind == kTrip) {
            report_trip(sequence);
        } else if (has_last_ && kind == last_kind_ && sequence == last_sequence_) {
            acknowledge(kind, sequence, last_result_);  // a repeat: its answer was lost
        } else {
            const Result result = execute(kind, payload + kHeaderSize, size - kHeaderSize);
            if (kind == kArm || kind == kStart || kind == kSetpoints) {
                has_last_ = true;
                last_kind_ = kind;
                last_sequence_ = sequence;
                last_result_ = result;
            }
            acknowledge(kind, sequence, result);
        }
    }

    static Result fault_of(const std::uint8_t* payload, std::size_t size) {
        if (payload[0] != kVersion) return kWrongVersion;
        const std::size_t body = size - kHeaderSize;
        switch (payload[1]) {
            case kHello:
            case kStart:
            case kStop:
            case kDisarm:
            case kTrip:
                return body == 0 ? kOk : kWrongSize;
            case kArm:
                return body == Profile::kArmSize ? kOk : kWrongSize;
            case kReference:
                return body == kReferenceSize ? kOk : kWrongSize;
            case kPing:
                return size == kPingSize ? kOk : kWrongSize;
            case kSetpoints:
                return body > 0 && body % Profile::kSetpointSize == 0 &&
                               body / Profile::kSetpointSize <= Profile::kMaxSetpoints
                           ? kOk
                           : kWrongSize;
            default:
                return kUnknownKind;
        }
    }

    Result execute(std::uint8_t kind, const std::uint8_t* body, std::size_t size) {
        switch (kind) {
            case kArm:
                return arm(body);
            case kSetpoints:
                return take_setpoints(body, size / Profile::kSetpointSize);
            case kReference:
                return reference(body);
            case kStart:
                sequence_ = 0;
                streaming_ = true;
                return kOk;
            case kStop:
                streaming_ = false;
                return kOk;
            default:  // disarm: every other kind was refused
                release();
                return kOk;
        }
    }

    Result reference(const std::uint8_t* body) {
        if (armed() || holding() || !reference_.at_rest()) return kNotAtRest;
        Reader reader(body);
        std::int32_t counts[kEncoders];
        for (std::int32_t& count : counts) count = reader.i32();
        reference_.set(counts);
        status_ |= kReferenced;
        return kOk;
    }

    Result arm(const std::uint8_t* body) {
        if ((status_ & kReferenced) == 0) return kNotReferenced;
        Reader reader(body);
        if (!profile_.arm(reader)) return kBadValue;
        release();
        first_ = Crossing();
        first_us_ = 0;
        status_ = kArmed | kReferenced;
        return kOk;
    }

    Result take_setpoints(const std::uint8_t* body, std::size_t count) {
        if (!armed()) return kNotArmed;
        Reader check(body);
        for (std::size_t i = 0; i < count; ++i) {
            if (!profile_.allow(Setpoint::read(check))) return kBadValue;
        }
        if (count > queue_.free()) return kQueueFull;
        Reader reader(body);
        for (std::size_t i = 0; i < count; ++i) queue_.push(Setpoint::read(reader));
        return kOk;
    }

    void report_trip(std::uint16_t sequence) {
        const std::int64_t most_late_us = UINT32_MAX;
        const std::int64_t late_us = first_.late_us < most_late_us ? first_.late_us : most_late_us;
        send(begin(kTripReport, sequence)
                 .u8(first_.code)
                 .u8(first_.channel)
                 .i32(clip32(first_.value))
                 .i32(clip32(first_.limit))
                 .u32(first_us_)
                 .u32(static_cast<std::uint32_t>(late_us)));
    }

    void acknowledge(std::uint8_t command, std::uint16_t sequence, Result result) {
        send(begin(kAck, sequence)
                 .u8(command)
                 .u8(result)
                 .u16(status_)
                 .u16(static_cast<std::uint16_t>(queue_.free())));
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
        send(sample);
    }

    static Writer begin(Kind kind, std::uint16_t sequence) {
        Writer writer;
        writer.u8(kVersion).u8(kind).u16(sequence);
        return writer;
    }

    void send(const Writer& writer) { transmitter_.send(writer.bytes(), writer.size()); }

    std::uint8_t serial_[kSerialSize] = {};
    FrameReceiver receiver_;
    FrameTransmitter<TransmitCapacity> transmitter_;
    SetpointQueue<Setpoint, kQueueCapacity> queue_;
    Profile profile_;
    ReferencePoint<Profile> reference_;
    Crossing first_;  // since the board was armed
    std::uint32_t first_us_ = 0;
    Watchdog watchdog_;
    Setpoint held_;
    std::uint32_t now_us_ = 0;
    std::uint32_t sequence_ = 0;
    std::uint32_t boot_ = 0;
    std::uint16_t status_ = 0;
    bool engaged_ = false;  // armed, and a setpoint has come
    bool streaming_ = false;
    bool has_last_ = false;
    std::uint8_t last_kind_ = 0;
    std::uint16_t last_sequence_ = 0;
    Result last_result_ = kOk;
};

}  // namespace rig
