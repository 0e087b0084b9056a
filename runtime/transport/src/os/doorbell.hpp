#pragma once

#include <optional>

#include "rtpm/transport/socket.hpp"

namespace rtpm::transport::os {

/// A descriptor that any thread can make readable.
/// @threads  ring(): any; the rest: one at a time
/// @realtime alloc-free, one system call, except open()
class Doorbell {
 public:
  /// Nothing if no descriptor is left; errno has the reason.
  [[nodiscard]] static std::optional<Doorbell> open() noexcept;
  [[nodiscard]] int descriptor() const noexcept { return heard_.number(); }
  /// Makes the descriptor readable until clear().
  void ring() noexcept;
  void clear() noexcept;

 private:
  Doorbell(Descriptor heard, Descriptor rung) noexcept
      : heard_(std::move(heard)), rung_(std::move(rung)) {}
  Descriptor heard_;
  Descriptor rung_;  ///< Not open if both are one.
};

}  // namespace rtpm::transport::os
