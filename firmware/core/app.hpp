// A board on whatever hardware there is: the tick of the sampling timer, and the bytes in between.
//
// Hardware offers
//   std::uint32_t now_us();                                a free-running timer; it may wrap
//   Profile::Inputs sample();                              counts; rig::kMissing where there is none
//   void drive(const Profile::Outputs&);                   set values of the motors
//   std::size_t read(std::uint8_t* out, std::size_t room);  bytes from the host, without waiting
//   std::size_t write(const std::uint8_t*, std::size_t);    takes what it can without waiting
//   void feed();                                           keeps the chip's own watchdog from resetting it
//   bool stopped();                                        whether an emergency stop is asked for
//   class Lock;                                            keeps the tick out while it lives
#pragma once

#include <cstddef>
#include <cstdint>

#include "board.hpp"
#include "liveness.hpp"

namespace rig {

template <class Profile, class Hardware, std::size_t TransmitCapacity>
class App {
  public:
    using Settings = typename Profile::Settings;

    App(Hardware& hardware, const char* serial) : hardware_(hardware), board_(serial) {}

    // Before the first tick; see Board::booted and Board::limit_to.
    void begin(std::uint32_t boot, const Settings& own, bool simulated = false) {
        board_.booted(boot, simulated);
        board_.limit_to(own);
    }

    // Once every Profile::kTickUs, from the sampling timer.
    void tick(std::uint32_t tick_us) {
        hardware_.drive(board_.tick(tick_us, hardware_.sample(), hardware_.stopped()));
        if (liveness_.ticked()) hardware_.feed();
    }
    void tick() { tick(hardware_.now_us()); }

    // From the main loop, as often as there is time.
    void exchange() {
        std::uint8_t bytes[kChunk];
        const std::size_t received = hardware_.read(bytes, kChunk);
        board_.template receive<typename Hardware::Lock>(bytes, received);
        if (first_ == last_) fill();
        if (first_ < last_) first_ += hardware_.write(waiting_ + first_, last_ - first_);
        liveness_.turned();
    }

  private:
    static constexpr std::size_t kChunk = 512;
    static constexpr std::size_t kPiece = 64;  // what is copied while the tick is kept out

    void fill() {
        first_ = last_ = 0;
        for (std::size_t got = 1; got != 0 && last_ < kChunk; last_ += got) {
            const std::size_t room = kChunk - last_;  // not whole pieces: a tick may add to the last one
            const typename Hardware::Lock lock;
            got = board_.transmit(waiting_ + last_, room < kPiece ? room : kPiece);
        }
    }

    Hardware& hardware_;
    Board<Profile, TransmitCapacity> board_;
    Liveness liveness_;
    std::uint8_t waiting_[kChunk] = {};
    std::size_t first_ = 0;
    std::size_t last_ = 0;
};

}  // namespace rig
