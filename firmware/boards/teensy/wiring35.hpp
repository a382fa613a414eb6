// What is wired to which pin of the Teensy 3.5, and the scalings set in ESCON Studio. Nothing here is
// known from outside: change it to your rig and flash.
#pragma once

#include <Arduino.h>

#include "../escon.hpp"
#include "own_reference.hpp"
#include "torque_cells.hpp"

namespace rig::wiring {

constexpr char kSerial[] = "TEENSY35";  // the chip's number follows

// The motor is at pins 3 and 4 (FTM1), the jaw at 29 and 30 (FTM2): the hardware has no others. The
// spindle's pins are both of port C, whose interrupt priority is raised. All take 5 V.
constexpr int kSpindleA = 9, kSpindleB = 10;
constexpr int kSpindleIndex = 5;  // the encoder's output X; open where it has none
constexpr int kSamplePriority = 32;  // above USB: its interrupts may wait, the sample may not
constexpr int kEdgePriority = 16;

constexpr int kProximalPin = 14, kDistalPin = 15, kFsrPin = 16;  // A0, A1, A2
constexpr int kDriveCurrentPin = 17;                             // A3
constexpr int kAdcBits = 12;
constexpr int kTorqueZero = 2048;  // counts of a cell's amplifier at mid-scale
// Or write AdsPins or HxPins in the last line: an ADS1256 with the proximal cell at inputs 0-1 and the distal one at 2-3,
// or two HX711 (drivers/ads1256, drivers/hx711).
using AdsPins = AdsCells<ConverterPins<20, 22, 21, 23>>;  // SCLK, DOUT, DIN, DRDY; CS to ground
using HxPins = HxCells<ConverterPins<20, 22>, ConverterPins<18, 19>>;  // PD_SCK and DOUT of each
using AnalogPins = AnalogCells<kProximalPin, kDistalPin, kTorqueZero>;
using TorquePins = AnalogPins;

// Set values are the size of the current by its two converters, 0 A at 0 V: a broken wire or a board without
// power asks for nothing. The sign is the direction line's.
constexpr int kDriveSetPin = A21, kLoadSetPin = A22;
constexpr int kDriveEnablePin = 24, kLoadEnablePin = 25;
constexpr int kDriveReadyPin = 26, kLoadReadyPin = 27;  // low where the controller is ready
constexpr int kDriveDirectionPin = 11, kLoadDirectionPin = 12;  // high: positive current
constexpr int kStopPin = 2;  // emergency stop: a contact to ground that opens when it is pressed
constexpr int kAlivePin = 28;  // toggles while the chip is alive
constexpr float kPwmHz = 0.0F;  // none
constexpr int kSetBits = 12;
constexpr double kDriveFullScaleA = 2.0;  // current of a full command; a positive command opens
constexpr std::uint32_t kReadyAfterTicks = 20;  // enable acts within 8 ms

constexpr EsconWiring kDrive{{0.0, 0.0, 3.3, 2.0}, 3.3, {0.0, -2.0, 3.3, 2.0}, 3.3, 2.0};
constexpr EsconWiring kLoad{{0.0, 0.0, 3.3, 2.0}, 3.3, {0.0, -2.0, 3.3, 2.0}, 3.3, 2.0};

}  // namespace rig::wiring
