// The converters that may stand at a board's pins, each against a fake chip made from its data sheet: one contract for
// the converters of load cells, and the scaling of a current amplifier.
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>

#include <vector>

#include "../boards/ads1256.hpp"
#include "../boards/escon.hpp"
#include "../boards/hx711.hpp"

namespace {

// An HX711: low data while a conversion waits, a bit a rising edge, off when the clock stays high.
class HxChip {
  public:
    bool alive = true;

    void convert(std::int32_t value) { bits_ = static_cast<std::uint32_t>(value), pulses_ = 0, ready_ = true; }
    void clock(bool level) {
        if (level && !clock_) ++pulses_;
        if (pulses_ >= 25) ready_ = false;
        high_ns_ = 0;
        clock_ = level;
    }
    bool data() const {
        if (!alive || !ready_) return true;
        return pulses_ > 0 && pulses_ <= 24 && (bits_ >> (24 - pulses_) & 1) != 0;
    }
    void wait_ns(int time) {
        if (clock_) high_ns_ += time;
        REQUIRE(high_ns_ < 50000);
    }
    int pulses() const { return pulses_; }

  private:
    std::uint32_t bits_ = 0;
    int pulses_ = 0;
    int high_ns_ = 0;
    bool clock_ = false, ready_ = false;
};

// An ADS1256: reads at falling edges, answers at rising ones not before t6 behind the command; converts the input that
// was selected when it was last synchronised.
class AdsChip {
  public:
    bool alive = true;
    int value[4] = {};  // at the differential inputs
    unsigned registers[4] = {0x30, 0x01, 0x20, 0xF0};

    void convert() { ready_ = alive, result_ = value[converting_]; }
    bool ready() const { return ready_; }
    void out(bool level) { in_ = level; }
    bool data() const { return alive && answer_bit_; }
    void wait_ns(int time) { idle_ns_ += time; }
    void clock(bool level) {
        if (level && !clock_) rise();
        if (!level && clock_) fall();
        clock_ = level;
    }

  private:
    void rise() {
        if (answers_.empty()) return;
        if (bit_ == 0 && first_answer_) REQUIRE(idle_ns_ >= 6510);
        first_answer_ = false;
        answer_bit_ = (answers_.front() >> (7 - bit_) & 1) != 0;
    }
    void fall() {
        shift_ = (shift_ << 1 | (in_ ? 1 : 0)) & 0xFF;
        idle_ns_ = 0;
        if (++bit_ < 8) return;
        bit_ = 0;
        if (answers_.empty()) return take(shift_);
        answers_.erase(answers_.begin());
    }
    void take(unsigned byte) {
        if (writes_ > 0) {
            registers[at_++] = byte;
            --writes_;
        } else if (counts_) {
            counts_ = false;
            if (reads_) {
                for (unsigned k = 0; k <= byte; ++k) answers_.push_back(registers[at_ + k]);
                first_answer_ = true;
            } else {
                writes_ = byte + 1;
            }
        } else if ((byte & 0xF0) == 0x50 || (byte & 0xF0) == 0x10) {
            counts_ = true;
            reads_ = (byte & 0xF0) == 0x10;
            at_ = byte & 0x0F;
        } else if (byte == 0xFC) {
            ready_ = false;
            converting_ = (registers[1] >> 4) / 2;
        } else if (byte == 0x01) {
            for (int shift : {16, 8, 0}) answers_.push_back(static_cast<unsigned>(result_) >> shift & 0xFF);
            first_answer_ = true;
        }
    }

    std::vector<unsigned> answers_;
    unsigned shift_ = 0, at_ = 0, writes_ = 0, converting_ = 0;
    int result_ = 0, bit_ = 0, idle_ns_ = 0;
    bool in_ = false, clock_ = false, ready_ = false, answer_bit_ = false, first_answer_ = false;
    bool counts_ = false, reads_ = false;
};

struct Hx {
    static constexpr std::uint32_t kLongest = rig::Hx711<HxChip>::kLongestTicks;
    rig::Hx711<HxChip> converter;

    void begin(bool alive) {
        converter.pins.alive = alive;
        converter.begin();
    }
    std::int32_t convert(std::int32_t value) {
        converter.pins.convert(value);
        return converter.read();
    }
    std::int32_t nothing() { return converter.read(); }
};

struct Ads {
    static constexpr std::uint32_t kLongest = rig::Ads1256<AdsChip, 2>::kLongestTicks;
    rig::Ads1256<AdsChip, 2> converter;

    void begin(bool alive) {
        converter.pins.alive = alive;
        converter.begin(6);
    }
    std::int32_t convert(std::int32_t value) {
        converter.pins.value[0] = value;
        converter.pins.value[1] = -5 * 256;
        std::int32_t count = 0;
        for (int k = 0; k < 2; ++k) {
            converter.pins.convert();
            converter.step();
            count = converter.count(0);
            CHECK((converter.count(1) == -5 || converter.count(1) == rig::kMissing));
        }
        return count;
    }
    std::int32_t nothing() {
        converter.step();
        return converter.count(0);
    }
};

}  // namespace

TEST_CASE_TEMPLATE("a converter gives 16 of its 24 bits, and the field's ends at its own", Cell, Hx, Ads) {
    Cell cell;
    cell.begin(true);
    CHECK(cell.nothing() == rig::kMissing);  // no conversion yet
    for (std::int32_t count : {1, -1, 1000, -1000, 32766, -32767, 0x1234, -0x1234}) {
        CHECK(cell.convert(count * 256 + 7) == count);
    }
    CHECK(cell.convert(0x7FFFFF) == INT16_MAX);
    CHECK(cell.convert(-0x800000) == INT16_MIN);
}

TEST_CASE_TEMPLATE("a converter that stops keeps its count for its longest time, and is missing then", Cell, Hx, Ads) {
    Cell cell;
    cell.begin(true);
    REQUIRE(cell.convert(42 * 256) == 42);
    std::uint32_t kept = 0;
    while (cell.nothing() == 42) REQUIRE(++kept <= Cell::kLongest);
    CHECK(kept + 2 >= Cell::kLongest);
    CHECK(cell.nothing() == rig::kMissing);
    CHECK(cell.convert(43 * 256) == 43);
}

TEST_CASE_TEMPLATE("a converter that is not there is missing, and no tick waits for it", Cell, Hx, Ads) {
    Cell cell;
    cell.begin(false);
    for (int tick = 0; tick < 10; ++tick) CHECK(cell.nothing() == rig::kMissing);
}

TEST_CASE("an HX711 is given 25 pulses, for channel A with gain 128 the next time") {
    Hx cell;
    cell.begin(true);
    cell.convert(0);
    CHECK(cell.converter.pins.pulses() == 25);
}

TEST_CASE("an ADS1256 is set to differential inputs, gain 64 and 2000 conversions a second") {
    Ads cell;
    cell.begin(true);
    const unsigned* set = cell.converter.pins.registers;
    CHECK((set[0] == 0x06 && set[1] == 0x01 && set[2] == 0x06 && set[3] == 0xB0));
    cell.converter.pins.convert();
    cell.converter.step();
    CHECK(set[1] == 0x23);
}

TEST_CASE("an INA240 measures both signs of a current, and does not at its ends") {
    const rig::EsconWiring wiring{{0.0, 0.0, 3.3, 2.0}, 3.3, rig::ina240(0.02, 50, 1.65, 3.3), 3.3, 2.0,
                                  12, 12, 0.05, 3.1};
    const auto counts = [](double volt) { return static_cast<std::int32_t>(volt / 3.3 * 4095 + 0.5); };
    CHECK(std::abs(wiring.milliampere(counts(1.65))) <= 1);  // 1 V is 1 A
    CHECK(wiring.milliampere(counts(2.65)) == doctest::Approx(1000).epsilon(0.001));
    CHECK(wiring.milliampere(counts(0.65)) == doctest::Approx(-1000).epsilon(0.001));
    CHECK(wiring.milliampere(counts(3.12)) == INT16_MAX);
    CHECK(wiring.milliampere(counts(0.03)) == INT16_MIN);
}
