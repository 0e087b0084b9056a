#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::transport {

/// Several descriptors, an alarm and a doorbell as one descriptor, which an event loop of any kind
/// can poll: it is readable while one of them has something to report.
/// @threads  ring(): any; the rest: one at a time
/// @realtime alloc-free, except open()
class MergedDescriptor {
 public:
  /// @errors  no descriptor left
  [[nodiscard]] static expected<std::unique_ptr<MergedDescriptor>, SetupError> open();

  [[nodiscard]] int number() const noexcept { return epoll_.number(); }
  /// Reports `descriptor` as `tag` when it is readable or broken, once; then watch it again. One
  /// that is closed is no longer reported; at worst once, if a child process has it, too.
  /// @param tag  at most kTagMax
  /// @return false if the system refuses
  /// @realtime at most two system calls
  [[nodiscard]] bool watch(int descriptor, std::uint64_t tag) noexcept;
  /// @realtime one system call
  void unwatch(int descriptor) noexcept;
  /// Makes it readable from `time` until the next set_alarm(), which replaces the alarm; kNever for
  /// none.
  /// @realtime one system call
  void set_alarm(MonotonicTime time) noexcept;
  /// Makes it readable until the next take().
  /// @realtime one system call
  void ring() noexcept;
  /// Returns the tags that are ready now. If there are more, it stays readable.
  /// @realtime one system call; one more after ring()
  [[nodiscard]] std::span<std::uint64_t> take(std::span<std::uint64_t> ready) noexcept;

  static constexpr std::uint64_t kTagMax = ~std::uint64_t{2};

 private:
  MergedDescriptor() noexcept = default;
  [[nodiscard]] bool control(int operation, int descriptor, std::uint32_t events,
                             std::uint64_t tag) noexcept;

  Descriptor epoll_;
  Descriptor alarm_;
  Descriptor doorbell_;
};

}  // namespace rtpm::transport
