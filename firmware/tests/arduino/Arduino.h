// The parts of the Arduino core that the Teensy's layer uses, for a host: what was written can be seen,
// what is read can be set.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>

constexpr int LOW = 0, HIGH = 1, INPUT = 0, OUTPUT = 1, INPUT_PULLUP = 2, INPUT_PULLDOWN = 3;
constexpr int RISING = 3, CHANGE = 4;

struct FakeBoard {
    std::map<int, int> modes, levels, duties, analog, priorities;
    std::map<int, void (*)()> edges;
    int locked = 0;
    std::uint32_t now_us = 0;
};
inline FakeBoard board;

inline void pinMode(int pin, int mode) { board.modes[pin] = mode; }
inline void digitalWrite(int pin, int level) { board.levels[pin] = level; }
inline int digitalRead(int pin) { return board.levels.count(pin) != 0 ? board.levels[pin] : HIGH; }
inline int analogRead(int pin) { return board.analog[pin]; }
inline void analogWrite(int pin, int duty) { board.duties[pin] = duty; }
inline void analogWriteFrequency(int, float) {}
inline void analogWriteResolution(int) {}
inline void analogReadResolution(int) {}
inline void analogReadAveraging(int) {}
inline void digitalWriteFast(int pin, int level) { digitalWrite(pin, level); }
inline void delayNanoseconds(std::uint32_t) {}
inline int digitalReadFast(int pin) { return digitalRead(pin); }
inline int digitalPinToInterrupt(int pin) { return pin; }
inline void attachInterrupt(int pin, void (*called)(), int) { board.edges[pin] = called; }
inline std::uint32_t micros() { return board.now_us; }
inline void noInterrupts() { ++board.locked; }
inline void interrupts() { --board.locked; }

struct FakeSerial {
    std::deque<std::uint8_t> in, out;
    int room = 512;
    void begin(int) {}
    int available() const { return static_cast<int>(in.size()); }
    int read() {
        const int byte = in.front();
        in.pop_front();
        return byte;
    }
    int availableForWrite() const { return room; }
    std::size_t write(const std::uint8_t* data, std::size_t size) {
        if (detached) return static_cast<std::size_t>(-1);
        out.insert(out.end(), data, data + size);
        return size;
    }
    void send_now() {}
    bool detached = false;  // the core then gives -1, as a size
};
inline FakeSerial Serial;

struct IntervalTimer {
    void (*function)() = nullptr;
    int level = 128;
    int period_us = 0;
    bool works = true;
    void priority(int asked) { level = asked; }
    bool begin(void (*called)(), int every_us) {
        function = called;
        period_us = every_us;
        return works;
    }
};

// what the Teensy 3.5's core calls the registers and pins that its layer uses
constexpr int A21 = 66, A22 = 67, IRQ_PORTC = 61;
constexpr std::uint32_t FTM_MODE_WPDIS = 4, FTM_MODE_FTMEN = 1, FTM_QDCTRL_QUADEN = 1;
constexpr std::uint32_t PORT_PCR_MUX(std::uint32_t function) { return function << 8; }
inline volatile std::uint32_t PORTA_PCR12, PORTA_PCR13, PORTB_PCR18, PORTB_PCR19;
constexpr std::uint32_t FTM_QDCTRL_PHAFLTREN = 0x80, FTM_QDCTRL_PHBFLTREN = 0x40;
inline volatile std::uint32_t FTM1_FILTER, FTM2_FILTER;
constexpr std::uint32_t SIM_UIDML = 0x1234, SIM_UIDL = 0x5678;     // the chips' own numbers
constexpr std::uint32_t HW_OCOTP_CFG0 = 0x1234, HW_OCOTP_CFG1 = 0x5678;
inline volatile std::uint32_t FTM1_MODE, FTM1_SC, FTM1_CNTIN, FTM1_MOD, FTM1_CNT, FTM1_QDCTRL;
inline volatile std::uint32_t FTM2_MODE, FTM2_SC, FTM2_CNTIN, FTM2_MOD, FTM2_CNT, FTM2_QDCTRL;

// the registers of the chip's watchdog: what was written last, and how often
struct FakeRegister {
    std::uint32_t value = 0;
    int writes = 0;
    FakeRegister& operator=(std::uint32_t written) {
        value = written;
        ++writes;
        return *this;
    }
    FakeRegister& operator|=(std::uint32_t bits) { return *this = value | bits; }
    operator std::uint32_t() const { return value; }
};
inline FakeRegister CCM_CCGR5, WDOG3_CS, WDOG3_CNT, WDOG3_TOVAL;
inline FakeRegister WDOG_UNLOCK, WDOG_TOVALH, WDOG_TOVALL, WDOG_PRESC, WDOG_STCTRLH, WDOG_REFRESH;
constexpr std::uint32_t CCM_CCGR_ON = 3, WDOG_CS_STOP = 1, WDOG_CS_WAIT = 2, WDOG_CS_UPDATE = 1U << 5;
constexpr std::uint32_t WDOG_CS_EN = 1U << 7, WDOG_CS_CMD32EN = 1U << 13;
constexpr std::uint32_t CCM_CCGR5_WDOG3(std::uint32_t gate) { return gate << 4; }
constexpr std::uint32_t WDOG_CS_CLK(std::uint32_t source) { return source << 8; }
constexpr std::uint32_t WDOG_UNLOCK_SEQ1 = 0xC520, WDOG_UNLOCK_SEQ2 = 0xD928;
constexpr std::uint32_t WDOG_STCTRLH_WDOGEN = 1, WDOG_STCTRLH_ALLOWUPDATE = 16;
constexpr std::uint32_t WDOG_STCTRLH_STOPEN = 64, WDOG_STCTRLH_WAITEN = 128;
inline void NVIC_SET_PRIORITY(int line, int level) { board.priorities[line] = level; }
