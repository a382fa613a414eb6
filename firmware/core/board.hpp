// The logger board without its hardware: bytes and sampled inputs in, commands and bytes out. A board
// layer calls `receive` with what came from the host, `tick` once a millisecond, and `transmit` when
// the host can take bytes. The Python twin is drivers/teensy/fake.py.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "control.hpp"
#include "framing.hpp"
#include "guard.hpp"
#include "protocol.hpp"
#include "setpoint_queue.hpp"
#include "watchdog.hpp"

namespace rig {

struct Outputs {
    std::int32_t command_e4 = 0;
    std::int32_t load_ma = 0;
};

template <std::size_t TransmitCapacity>
class Board {
  public:
    explicit Board(const char* serial) {
        for (std::size_t i = 0; i < kSerialSize && serial[i] != '\0'; ++i) {
            serial_[i] = static_cast<std::uint8_t>(serial[i]);
        }
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

    Outputs tick(std::uint32_t tick_us, const Inputs& inputs) {
        now_us_ = tick_us;
        const std::uint32_t silent_us = watchdog_.silent_us(tick_us);
        const std::int64_t patience_us = guard_.limits().watchdog_us;
        if (armed() && silent_us > patience_us) {
            trip({kHostSilent, kNoChannel, silent_us, patience_us, silent_us}, inputs);
        }
        if (armed() || holding()) {
            const Crossing crossing = guard_.check(inputs);
            if (crossing.code != kNoTrip) trip(crossing, inputs);
        }
        const bool dry = armed() && queue_.empty();
        if (armed() && !queue_.empty()) {
            held_ = queue_.pop();
            engaged_ = true;
        }
        Outputs outputs;
        if (engaged_ || holding()) {
            outputs.command_e4 = controller_.tick(held_.target, inputs.spindle, inputs.motor);
            outputs.load_ma = held_.load_ma;
        }
        if (streaming_) log(tick_us, inputs, outputs, dry);
        return outputs;
    }

  private:
    bool armed() const { return (status_ & kArmed) != 0; }
    bool holding() const { return (status_ & kHolding) != 0; }

    // Goes to the safe state; the first cause stays.
    void trip(const Crossing& crossing, const Inputs& inputs) {
        const bool hold = guard_.limits().safe_state == kHold && armed() &&
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
        if (hold) {
            status |= kHolding;
            held_.target = inputs.spindle;
            held_.load_ma = 0;
            controller_.limit_to(guard_.limits().hold_command_e4);
            guard_.begin_to_hold();
        }
        status_ = static_cast<std::uint16_t>(status);
    }

    // Takes the motors out of force and forgets what was to be done; the latches stay.
    void release() {
        status_ = status_ & (kWatchdogTripped | kLimitTripped | 0xFF << kTripShift);
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
            reply.u32(kProtocolHash).u32(kFirmwareVersion).u32(kBuildHash);
            for (std::uint8_t character : serial_) reply.u8(character);
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
                return size == kArmSize ? kOk : kWrongSize;
            case kPing:
                return size == kPingSize ? kOk : kWrongSize;
            case kSetpoints:
                return body > 0 && body % kSetpointSize == 0 && body / kSetpointSize <= kMaxSetpoints
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
                return take_setpoints(body, size / kSetpointSize);
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

    Result arm(const std::uint8_t* body) {
        Reader reader(body);
        Gains gains;
        for (double* gain : {&gains.kp, &gains.ki, &gains.kd, &gains.velocity_filter, &gains.limit}) {
            *gain = reader.f64();
        }
        const Limits limits = Limits::read(reader);
        if (!gains.valid() || !limits.valid()) return kBadValue;
        release();
        guard_.arm(limits);
        first_ = Crossing();
        first_us_ = 0;
        controller_.reset(gains);
        status_ = kArmed;
        return kOk;
    }

    Result take_setpoints(const std::uint8_t* body, std::size_t count) {
        if (!armed()) return kNotArmed;
        Reader check(body);
        for (std::size_t i = 0; i < count; ++i) {
            const std::int32_t target = check.i32();
            if (!guard_.limits().allow(target, check.i16())) return kBadValue;
        }
        if (count > queue_.free()) return kQueueFull;
        Reader reader(body);
        for (std::size_t i = 0; i < count; ++i) {
            Setpoint setpoint;
            setpoint.target = reader.i32();
            setpoint.load_ma = reader.i16();
            queue_.push(setpoint);
        }
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
        if (saturated(inputs)) status |= kSaturated;
        if (dry) status |= kQueueDry;
        Writer sample;
        sample.u8(kVersion).u8(kSample).u16(static_cast<std::uint16_t>(status));
        sample.u32(sequence_++).u32(tick_us);
        sample.i32(inputs.motor).i32(inputs.spindle).i32(inputs.jaw);
        sample.i32(engaged_ || holding() ? held_.target : inputs.spindle);
        sample.i16(clip16(inputs.proximal)).i16(clip16(inputs.distal)).i16(clip16(inputs.current));
        sample.u16(static_cast<std::uint16_t>(clip(inputs.fsr, 0, 65535)));
        sample.i16(clip16(outputs.command_e4)).i16(clip16(outputs.load_ma));
        sample.u16(transmitter_.dropped());
        send(sample);
    }

    static bool saturated(const Inputs& inputs) {
        for (std::int32_t count : {inputs.proximal, inputs.distal, inputs.current}) {
            if (count <= INT16_MIN || count >= INT16_MAX) return true;
        }
        return inputs.fsr >= kFsrMax;
    }

    static std::int32_t clip(std::int32_t value, std::int32_t low, std::int32_t high) {
        if (value < low) return low;
        return value > high ? high : value;
    }
    static std::int32_t clip32(std::int64_t value) {
        if (value < INT32_MIN) return INT32_MIN;
        return value > INT32_MAX ? INT32_MAX : static_cast<std::int32_t>(value);
    }
    static std::int16_t clip16(std::int32_t value) {
        return static_cast<std::int16_t>(clip(value, INT16_MIN, INT16_MAX));
    }

    static Writer begin(Kind kind, std::uint16_t sequence) {
        Writer writer;
        writer.u8(kVersion).u8(kind).u16(sequence);
        return writer;
    }

    void send(const Writer& writer) { transmitter_.send(writer.bytes(), writer.size()); }

    static constexpr std::int32_t kFsrMax = 4095;

    std::uint8_t serial_[kSerialSize] = {};
    FrameReceiver receiver_;
    FrameTransmitter<TransmitCapacity> transmitter_;
    SetpointQueue<kQueueCapacity> queue_;
    Controller controller_;
    Guard guard_;
    Crossing first_;  // since the board was armed
    std::uint32_t first_us_ = 0;
    Watchdog watchdog_;
    Setpoint held_;
    std::uint32_t now_us_ = 0;
    std::uint32_t sequence_ = 0;
    std::uint16_t status_ = 0;
    bool engaged_ = false;  // armed, and a setpoint has come
    bool streaming_ = false;
    bool has_last_ = false;
    std::uint8_t last_kind_ = 0;
    std::uint16_t last_sequence_ = 0;
    Result last_result_ = kOk;
};

}  // namespace rig
