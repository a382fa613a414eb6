// The firmware as a process of its own, in real time, on a pseudo-terminal: what a board on USB is to
// a host, with a small plant in place of the rig. Prints the terminal's path and runs until it is
// terminated or its parent is gone.
//   build/rig_firmware [reference | grasper]
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>

#include <fcntl.h>
#include <sys/prctl.h>
#include <termios.h>
#include <unistd.h>

#include "../core/app.hpp"
#include "plain_grasper.hpp"
#include "plain_plant.hpp"

namespace {

constexpr std::size_t kTransmitCapacity = 65536;

volatile std::sig_atomic_t ended = 0;
void end(int) { ended = 1; }

std::uint64_t now_ns() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return static_cast<std::uint64_t>(now.tv_sec) * 1000000000U +
           static_cast<std::uint64_t>(now.tv_nsec);
}

void sleep_until(std::uint64_t when_ns) {
    timespec when{};
    when.tv_sec = static_cast<time_t>(when_ns / 1000000000U);
    when.tv_nsec = static_cast<long>(when_ns % 1000000000U);
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &when, nullptr) == EINTR && !ended) {
    }
}

template <class Profile, class Plant>
class PtyHardware {
  public:
    struct Lock {  // one thread: nothing to keep out
        Lock() {}
    };

    explicit PtyHardware(int master) : master_(master) {}

    std::uint32_t now_us() { return static_cast<std::uint32_t>(now_ns() / 1000U); }
    typename Profile::Inputs sample() { return plant_.sample(); }
    void drive(const typename Profile::Outputs& outputs) { plant_.step(outputs); }

    bool stopped() { return false; }  // no emergency stop is wired to it
    void feed() {}  // a process has no watchdog of its own

    std::size_t read(std::uint8_t* out, std::size_t room) { return some(::read(master_, out, room)); }
    std::size_t write(const std::uint8_t* data, std::size_t size) {
        return some(::write(master_, data, size));
    }

  private:
    // nothing there, no reader at the other end, or no room: the same to a board
    static std::size_t some(ssize_t count) { return count > 0 ? static_cast<std::size_t>(count) : 0; }

    int master_;
    Plant plant_;
};

int open_master() {
    const int master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) return -1;
    termios raw{};
    if (tcgetattr(master, &raw) != 0) return -1;
    cfmakeraw(&raw);
    return tcsetattr(master, TCSANOW, &raw) == 0 ? master : -1;
}

template <class Profile, class Plant>
void run(int master, const char* serial) {
    using Hardware = PtyHardware<Profile, Plant>;
    constexpr std::uint64_t kTickNs = 1000U * static_cast<std::uint64_t>(Profile::kTickUs);
    Hardware hardware(master);
    static rig::App<Profile, Hardware, kTransmitCapacity> app(hardware, serial);
    const std::uint64_t began_ns = now_ns();
    app.begin(static_cast<std::uint32_t>(began_ns / 1000U), Profile::Settings::widest(), true);
    for (std::uint64_t tick = 1; !ended; ++tick) {
        // the clock decides when a tick is due, so a process that slept too long catches up
        const std::uint64_t due_ns = began_ns + tick * kTickNs;
        if (now_ns() < due_ns) sleep_until(due_ns);
        app.exchange();
        app.tick(static_cast<std::uint32_t>(due_ns / 1000U));
        app.exchange();
    }
}

}  // namespace

int main(int count, char** words) {
    const char* profile = count > 1 ? words[1] : "reference";
    const bool grasper = std::strcmp(profile, "grasper") == 0;
    if (!grasper && std::strcmp(profile, "reference") != 0) {
        std::fprintf(stderr, "no profile %s: reference or grasper\n", profile);
        return 2;
    }
    std::signal(SIGTERM, end);
    std::signal(SIGINT, SIG_IGN);  // Ctrl-C is the host's; the board makes itself safe
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    const int master = open_master();
    if (master < 0) {
        std::perror("no pseudo-terminal");
        return 1;
    }
    std::printf("%s\n", ptsname(master));
    std::fflush(stdout);
    if (grasper) {
        run<rig::GrasperProfile, rig::PlainGrasper>(master, "PTY-GRASPER-0001");
    } else {
        run<rig::ReferenceProfile, rig::PlainPlant>(master, "PTY-0001");
    }
    return 0;
}
