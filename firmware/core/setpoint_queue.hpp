// Setpoints the host sent ahead, one for each tick to come.
#pragma once

#include <array>
#include <cstddef>

namespace rig {

template <class Setpoint, std::size_t Capacity>
class SetpointQueue {
  public:
    std::size_t free() const { return Capacity - used_; }
    bool empty() const { return used_ == 0; }
    void clear() { used_ = 0; }

    // The caller has checked `free`.
    void push(const Setpoint& setpoint) { ring_[(first_ + used_++) % Capacity] = setpoint; }

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
