// The board as a shared library with a C interface, for the simulated rig: the same core that runs on
// the device, ticked from outside in virtual time. One thread per board.
#include "../boards/escon.hpp"
#include "../core/board.hpp"
#include "../core/profile_grasper.hpp"
#include "../core/profile_reference.hpp"

#include <cstring>
#include <new>

namespace {

constexpr std::size_t kTransmitCapacity = 65536;

// A board of any profile, its inputs and outputs as rows of whole numbers.
class HostBoard {
  public:
    virtual ~HostBoard() = default;
    virtual void booted(std::uint32_t boot, bool simulated) = 0;
    virtual void assume_hot() = 0;
    virtual bool limit_to(const std::uint8_t* settings) = 0;
    virtual void stop(bool stopped) = 0;
    virtual void index() = 0;
    virtual bool in_force() const = 0;
    virtual rig::Trip trip() const = 0;
    virtual void restore(rig::Trip code) = 0;
    virtual void skip(std::uint32_t ticks) = 0;
    virtual void receive(const std::uint8_t* data, std::size_t size) = 0;
    virtual void tick(std::uint32_t tick_us, const std::int32_t* inputs, std::int32_t* outputs) = 0;
    virtual std::size_t transmit(std::uint8_t* out, std::size_t room) = 0;
};

rig::ReferenceProfile::Inputs inputs_of(const std::int32_t* row, rig::ReferenceProfile) {
    return {row[0], row[1], row[2], row[3], row[4], row[5], row[6], false};
}

rig::GrasperProfile::Inputs inputs_of(const std::int32_t* row, rig::GrasperProfile) {
    rig::GrasperProfile::Inputs inputs;
    for (std::size_t k = 0; k < rig::GrasperProfile::kMotors; ++k) {
        inputs.motor[k] = row[k];
        inputs.current[k] = row[rig::GrasperProfile::kMotors + k];
        inputs.force[k] = row[2 * rig::GrasperProfile::kMotors + k];
    }
    return inputs;
}

void mark_indexed(rig::ReferenceProfile::Inputs& inputs) { inputs.indexed = true; }
void mark_indexed(rig::GrasperProfile::Inputs&) {}

void put(const rig::ReferenceProfile::Outputs& outputs, std::int32_t* row) {
    row[0] = outputs.command_e4;
    row[1] = outputs.load_ma;
}

void put(const rig::GrasperProfile::Outputs& outputs, std::int32_t* row) {
    for (std::int32_t command_e4 : outputs.command_e4) *row++ = command_e4;
}

// From the bytes of an arm command behind its session.
template <class Profile>
typename Profile::Settings settings_of(const std::uint8_t* bytes) {
    typename Profile::Settings settings;
    rig::Reader reader(bytes);
    settings.read(reader);
    return settings;
}

template <class Profile>
class ProfileBoard final : public HostBoard {
  public:
    explicit ProfileBoard(const char* serial) : board_(serial) {}

    void booted(std::uint32_t boot, bool simulated) override { board_.booted(boot, simulated); }
    void assume_hot() override { board_.assume_hot(); }
    bool limit_to(const std::uint8_t* bytes) override {
        const auto settings = settings_of<Profile>(bytes);
        if (settings.valid()) board_.limit_to(settings);
        return settings.valid();
    }
    void stop(bool stopped) override { stopped_ = stopped; }
    void index() override { index_ = true; }
    bool in_force() const override { return board_.in_force(); }
    rig::Trip trip() const override { return board_.trip(); }
    void restore(rig::Trip code) override { board_.restore(code); }
    void skip(std::uint32_t ticks) override { board_.skip(ticks); }
    void receive(const std::uint8_t* data, std::size_t size) override {
        board_.template receive<rig::NoLock>(data, size);
    }
    void tick(std::uint32_t tick_us, const std::int32_t* inputs, std::int32_t* outputs) override {
        auto now = inputs_of(inputs, Profile());
        if (index_) mark_indexed(now);
        index_ = false;
        put(board_.tick(tick_us, now, stopped_), outputs);
    }
    std::size_t transmit(std::uint8_t* out, std::size_t room) override {
        return board_.transmit(out, room);
    }

  private:
    rig::Board<Profile, kTransmitCapacity> board_;
    bool stopped_ = false;
    bool index_ = false;
};

// The guards alone, for a host that holds a board's limits against the samples as they arrive.
class HostGuard {
  public:
    virtual ~HostGuard() = default;
    virtual void check(const std::int32_t* inputs, std::int64_t ticks, std::int64_t* crossing) = 0;
};

template <class Profile>
class ProfileGuard final : public HostGuard {
  public:
    explicit ProfileGuard(const std::uint8_t* bytes) { profile_.begin(settings_of<Profile>(bytes)); }

    void check(const std::int32_t* inputs, std::int64_t ticks, std::int64_t* row) override {
        const auto now = inputs_of(inputs, Profile());
        if (ticks > 1) profile_.late(now, ticks);
        profile_.warm(now, ticks > 1 ? ticks : 1);
        const rig::Crossing crossing = profile_.check(now);
        row[0] = crossing.code;
        row[1] = crossing.channel;
        row[2] = crossing.value;
        row[3] = crossing.limit;
        row[4] = crossing.late_us;
    }

  private:
    Profile profile_;
};

// the module of the tests: 10 to 90 % duty is 0 to 2 A, 0 to 3.3 V is -2 to 2 A
constexpr rig::EsconWiring kEscon{{0.1, 0.0, 0.9, 2.0}, 1.0, {0.0, -2.0, 3.3, 2.0}, 3.3, 2.0};

HostBoard* board_of(void* handle) { return static_cast<HostBoard*>(handle); }

}  // namespace

extern "C" {

// Returns null when there is no such profile, `reference` or `grasper`, or no memory.
void* rig_board_create(const char* profile, const char* serial) {
    HostBoard* board = nullptr;
    if (std::strcmp(profile, "reference") == 0) {
        board = new (std::nothrow) ProfileBoard<rig::ReferenceProfile>(serial);
    } else if (std::strcmp(profile, "grasper") == 0) {
        board = new (std::nothrow) ProfileBoard<rig::GrasperProfile>(serial);
    }
    return board;
}

void rig_board_destroy(void* board) { delete board_of(board); }

// The number of this start, and whether it is a simulated rig (1): its counts have their zeros, its motors are cold.
void rig_board_booted(void* board, std::uint32_t boot, std::int32_t simulated) {
    board_of(board)->booted(boot, simulated != 0);
}

// Nothing is known of what the motors did before: they count as hot as they may be.
void rig_board_assume_hot(void* board) { board_of(board)->assume_hot(); }

// The widest gains and limits the board takes, as in an arm command behind its session; 0 where they are not valid.
std::int32_t rig_board_limit(void* board, const std::uint8_t* settings) {
    return board_of(board)->limit_to(settings) ? 1 : 0;
}

// Whether somebody asks for an emergency stop from now on.
void rig_board_stop(void* board, std::int32_t stopped) { board_of(board)->stop(stopped != 0); }

// The index of the spindle's encoder comes with the next tick.
void rig_board_index(void* board) { board_of(board)->index(); }

// Whether motors are, or may at any tick be, given current.
std::int32_t rig_board_in_force(void* board) { return board_of(board)->in_force() ? 1 : 0; }

// What it has tripped over, 0 for nothing; and a trip from before this start.
std::int32_t rig_board_trip(void* board) { return board_of(board)->trip(); }
void rig_board_restore(void* board, std::int32_t code) {
    board_of(board)->restore(static_cast<rig::Trip>(code));
}

// Lets ticks pass that were not run.
void rig_board_skip(void* board, std::uint32_t ticks) { board_of(board)->skip(ticks); }

void rig_board_receive(void* board, const std::uint8_t* data, std::size_t size) {
    board_of(board)->receive(data, size);
}

// inputs: motor, spindle, jaw, proximal, distal, current, fsr counts; outputs: command_e4, load_ma.
// A grasper: three motor, three current, three force counts; outputs: three command_e4.
void rig_board_tick(void* board, std::uint32_t tick_us, const std::int32_t* inputs,
                    std::int32_t* outputs) {
    board_of(board)->tick(tick_us, inputs, outputs);
}

std::int32_t rig_escon_code(double current_a) { return kEscon.code(current_a); }
std::int32_t rig_escon_milliampere(std::int32_t reading) { return kEscon.milliampere(reading); }

// CRC-32 of the sources the core was built from.
std::uint32_t rig_board_build_hash() { return rig::kBuildHash; }

// The guards of a profile alone, with the gains and limits of an arm command behind its session.
void* rig_guard_create(const char* profile, const std::uint8_t* settings) {
    HostGuard* guard = nullptr;
    if (std::strcmp(profile, "reference") == 0) {
        guard = new (std::nothrow) ProfileGuard<rig::ReferenceProfile>(settings);
    } else if (std::strcmp(profile, "grasper") == 0) {
        guard = new (std::nothrow) ProfileGuard<rig::GrasperProfile>(settings);
    }
    return guard;
}

void rig_guard_destroy(void* guard) { delete static_cast<HostGuard*>(guard); }

// Checks rows of `width` inputs, each `ticks` ticks behind the one before, up to the first that crosses a limit.
// Returns its row, `count` where there is none; writes code, channel, value, limit and lateness, us.
std::size_t rig_guard_check(void* guard, const std::int32_t* rows, std::size_t width,
                            const std::int64_t* ticks, std::size_t count, std::int64_t* crossing) {
    for (std::size_t k = 0; k < count; ++k) {
        static_cast<HostGuard*>(guard)->check(rows + k * width, ticks[k], crossing);
        if (crossing[0] != rig::kNoTrip) return k;
    }
    return count;
}

// Writes at most `room` waiting bytes to `out`; returns how many.
std::size_t rig_board_transmit(void* board, std::uint8_t* out, std::size_t room) {
    return board_of(board)->transmit(out, room);
}

}  // extern "C"
