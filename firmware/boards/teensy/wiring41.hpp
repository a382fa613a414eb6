// What is wired to which pin of the Teensy 4.1, and the scalings set in ESCON Studio. Nothing here is
// known from outside: change it to your rig and flash.
#pragma once

#include "../escon.hpp"
#include "own_reference.hpp"
#include "torque_cells.hpp"
#include "crossbar41.hpp"

namespace rig::wiring {

constexpr char kSerial[] = "TEENSY41";  // the chip's number follows

// Three of the four hardware decoders. 3.3 V logic: an AMT102 (5 V) needs a level shifter.
constexpr int kMotorA = 0, kMotorB = 1;
constexpr int kSpindleA = 2, kSpindleB = 3;
constexpr int kJawA = 7, kJawB = 8;
static_assert(inputs_are_exclusive({kMotorA, kMotorB, kSpindleA, kSpindleB, kJawA, kJawB}),
              "two encoder pins share an input of the crossbar, or one reaches no decoder");

constexpr int kSpindleIndex = 32;  // the encoder's output X; open where it has none

constexpr int kSamplePriority = 32;  // above USB: its interrupts may wait, the sample may not

constexpr int kProximalPin = 14, kDistalPin = 15, kFsrPin = 16;  // A0, A1, A2
constexpr int kDriveCurrentPin = 17;                             // A3
constexpr int kAdcBits = 12;
constexpr int kTorqueZero = 2048;  // counts of a cell's amplifier at mid-scale
// Or write AdsPins or HxPins in the last line: an ADS1256 with the proximal cell at inputs 0-1 and the distal one at 2-3,
// or two HX711 (drivers/ads1256, drivers/hx711).
using AdsPins = AdsCells<ConverterPins<10, 12, 11, 6>>;  // SCLK, DOUT, DIN, DRDY; CS to ground
using HxPins = HxCells<ConverterPins<10, 12>, ConverterPins<5, 4>>;  // PD_SCK and DOUT of each
using AnalogPins = AnalogCells<kProximalPin, kDistalPin, kTorqueZero>;
using TorquePins = AnalogPins;

// This board has no DAC: set values are PWM, the size of the current as 10 to 90 % duty, 0 A at 10 % and below:
// a broken wire or a board without power asks for nothing. The sign is the direction line's.
constexpr int kDriveSetPin = 22, kLoadSetPin = 23;
// Not pins 24 and 25: they are LPUART1, which the processor's boot ROM may drive.
constexpr int kDriveEnablePin = 28, kLoadEnablePin = 29;
constexpr int kDriveReadyPin = 26, kLoadReadyPin = 27;  // low where the controller is ready
constexpr int kDriveDirectionPin = 20, kLoadDirectionPin = 21;  // high: positive current
constexpr int kStopPin = 9;  // emergency stop: a contact to ground that opens when it is pressed
constexpr int kAlivePin = 31;  // toggles while the chip is alive
constexpr float kPwmHz = 5000.0F;
constexpr int kSetBits = 12;
constexpr double kDriveFullScaleA = 2.0;  // current of a full command; a positive command opens
constexpr std::uint32_t kReadyAfterTicks = 20;  // enable acts within 8 ms

constexpr EsconWiring kDrive{{0.1, 0.0, 0.9, 2.0}, 1.0, {0.0, -2.0, 3.3, 2.0}, 3.3, 2.0};
constexpr EsconWiring kLoad{{0.1, 0.0, 0.9, 2.0}, 1.0, {0.0, -2.0, 3.3, 2.0}, 3.3, 2.0};

}  // namespace rig::wiring
