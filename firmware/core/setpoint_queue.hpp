// Setpoints the host sent ahead, one for each tick to come.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

namespace rig {

template <class Setpoint, std::size_t Capacity>
class SetpointQueue {
  public:
    std::size_t free() const { return Capacity - used_; }
    bool empty() const { return used_ == 0; }
    void clear() { used_ = 0; }

    // The caller has checked `free`. In two pieces, each one copy: the tick waits for it.
    void push(const Setpoint* setpoints, std::size_t count) {
        const std::size_t tail = (first_ + used_) % Capacity;
        const std::size_t piece = count < Capacity - tail ? count : Capacity - tail;
        std::copy(setpoints, setpoints + piece, ring_.begin() + static_cast<std::ptrdiff_t>(tail));
        std::copy(setpoints + piece, setpoints + count, ring_.begin());
        used_ += count;
    }

    // The caller has checked `empty`.
    const Setpoint& oldest() const { return ring_[first_]; }
    const Setpoint& newest() const { return ring_[(first_ + used_ - 1) % Capacity]; }

    // The caller has checked `empty`.
    Setpoint pop() {
        const Setpoint setpoint = ring_[first_];
        first_ = (first_ + 1) % Capacity;
        --used_;
        return setpoint;
    }

  private:
    std::array<Setpoint, Capacity> ring_{};
    std::size_t first_ = 0;
    std::size_t used_ = 0;
};

}  // namespace rig
