// What the board and the host say to each other. The contract is a text, the lines below and those of
// the board's profile: both sides compare its CRC-32 before anything moves. The twin is
// drivers/teensy/protocol.py, which spells the same text out of its layouts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>

namespace rig {

constexpr std::uint8_t kVersion = 1;
constexpr std::uint32_t kFirmwareVersion = 0x000400;
constexpr std::size_t kQueueCapacity = 2000;
constexpr std::int32_t kMinWatchdogUs = 5000;
constexpr std::int32_t kMaxWatchdogUs = 1000000;

// CRC-32 of the sources, set by the build
#ifndef RIG_BUILD_HASH
#define RIG_BUILD_HASH 0
#endif
constexpr std::uint32_t kBuildHash = RIG_BUILD_HASH;

// The lines of the contract that every profile has; its own are in its header.
constexpr char kFramingLines[] = "COBS(payload, CRC-16/CCITT-FALSE u2) 00\n";
constexpr char kAnswerLines[] =
    "2 HELLO_REPLY: version u1, kind u1, sequence u2, protocol_hash u4, firmware_version u4, "
    "build_hash u4, serial S24\n"
    "3 ACK: version u1, kind u1, sequence u2, command u1, result u1, status u2, queue_free u2\n"
    "4 PONG: version u1, kind u1, sequence u2, token u8, tick_us u4\n"
    "5 TRIP_REPORT: version u1, kind u1, sequence u2, code u1, channel u1, value i4, limit i4, "
    "tick_us u4, late_us u4\n"
    "16 HELLO: version u1, kind u1, sequence u2\n";
constexpr char kStartLine[] = "18 START: version u1, kind u1, sequence u2\n";
constexpr char kOtherLines[] =
    "20 STOP: version u1, kind u1, sequence u2\n"
    "21 DISARM: version u1, kind u1, sequence u2\n"
    "22 PING: version u1, kind u1, sequence u2, token u8\n"
    "23 TRIP: version u1, kind u1, sequence u2\n"
    "status: 1 ARMED, 2 SATURATED, 4 QUEUE_DRY, 8 WATCHDOG_TRIPPED, 16 LIMIT_TRIPPED, 32 "
    "HOLDING, trip << 8\n"
    "trip: 0 NONE, 1 HOST_SILENT, 2 OVER_CURRENT, 3 PROXIMAL_TORQUE, 4 DISTAL_TORQUE, 5 "
    "SPINDLE_TRAVEL, 6 JAW_TRAVEL, 7 OVER_SPEED, 8 OVERHEATED, 9 STALLED, 10 SENSOR_SATURATED, "
    "11 SENSOR_STALE, 12 SENSOR_MISSING, 13 MOTOR_TRAVEL, 14 OVER_FORCE, 15 ENCODERS_DISAGREE, "
    "16 FOLLOWING_ERROR, 17 CURRENT_MISMATCH, 18 ENCODER_JUMP, 19 ENCODER_FROZEN\n"
    "result: 0 OK, 1 UNKNOWN_KIND, 2 WRONG_SIZE, 3 BAD_VALUE, 4 QUEUE_FULL, 5 NOT_ARMED, 6 "
    "WRONG_VERSION\n";

enum Kind : std::uint8_t {
    kSample = 1,
    kHelloReply = 2,
    kAck = 3,
    kPong = 4,
    kTripReport = 5,
    kHello = 16,
    kArm = 17,
    kStart = 18,
    kSetpoints = 19,
    kStop = 20,
    kDisarm = 21,
    kPing = 22,
    kTrip = 23,
};

enum Status : std::uint16_t {
    kArmed = 1,
    kSaturated = 2,
    kQueueDry = 4,
    kWatchdogTripped = 8,
    kLimitTripped = 16,
    kHolding = 32,
};
constexpr unsigned kTripShift = 8;

enum Trip : std::uint8_t {
    kNoTrip = 0,
    kHostSilent = 1,
    kOverCurrent = 2,
    kProximalTorque = 3,
    kDistalTorque = 4,
    kSpindleTravel = 5,
    kJawTravel = 6,
    kOverSpeed = 7,
    kOverheated = 8,
    kStalled = 9,
    kSensorSaturated = 10,
    kSensorStale = 11,
    kSensorMissing = 12,
    kMotorTravel = 13,
    kOverForce = 14,
    kEncodersDisagree = 15,
    kFollowingError = 16,
    kCurrentMismatch = 17,
    kEncoderJump = 18,
    kEncoderFrozen = 19,
};

enum Result : std::uint8_t {
    kOk = 0,
    kUnknownKind = 1,
    kWrongSize = 2,
    kBadValue = 3,
    kQueueFull = 4,
    kNotArmed = 5,
    kWrongVersion = 6,
};

constexpr std::size_t kHeaderSize = 4;
constexpr std::size_t kSerialSize = 24;
constexpr std::size_t kPingSize = kHeaderSize + 8;

constexpr std::uint32_t crc32_next(std::uint32_t crc, const char* text) {
    for (; *text != '\0'; ++text) {
        crc ^= static_cast<std::uint8_t>(*text);
        for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
    }
    return crc;
}

constexpr std::uint32_t crc32(const char* text) { return ~crc32_next(0xFFFFFFFFU, text); }

// CRC-32 of the whole contract of a profile, in the order of the twin.
constexpr std::uint32_t protocol_hash(const char* title, const char* sample, const char* arm,
                                      const char* setpoints) {
    std::uint32_t crc = 0xFFFFFFFFU;
    for (const char* lines : {title, kFramingLines, sample, kAnswerLines, arm, kStartLine, setpoints,
                              kOtherLines}) {
        crc = crc32_next(crc, lines);
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

    std::uint8_t bytes_[64];  // more than the longest frame a board sends
    std::size_t size_ = 0;
};

// Reads little-endian fields one after another; the caller has checked the size.
class Reader {
  public:
    explicit Reader(const std::uint8_t* bytes) : bytes_(bytes) {}

    std::uint16_t u16() { return static_cast<std::uint16_t>(take(2)); }
    std::int16_t i16() { return static_cast<std::int16_t>(u16()); }
    std::int32_t i32() { return static_cast<std::int32_t>(take(4)); }
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
