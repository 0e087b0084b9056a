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
  MergedDescriptor() = default;
  MergedDescriptor(const MergedDescriptor&) = delete;
  MergedDescriptor& operator=(const MergedDescriptor&) = delete;
  virtual ~MergedDescriptor() = default;

  /// @errors  no descriptor left
  [[nodiscard]] static expected<std::unique_ptr<MergedDescriptor>, SetupError> open();

  [[nodiscard]] virtual int number() const noexcept = 0;
  /// Reports `descriptor` as `tag` when it is readable or broken, once; then watch it again. One
  /// that is closed is no longer reported; at worst once, if a child process has it, too.
  /// @param tag  at most kTagMax
  /// @return false if the system refuses
  /// @realtime at most two system calls
  [[nodiscard]] virtual bool watch(int descriptor, std::uint64_t tag) noexcept = 0;
  /// @realtime one system call
  virtual void unwatch(int descriptor) noexcept = 0;
  /// Makes it readable from `time` until the next set_alarm(), which replaces the alarm; kNever for
  /// none.
  /// @realtime one system call
  virtual void set_alarm(MonotonicTime time) noexcept = 0;
  /// Makes it readable until the next take().
  /// @realtime one system call
  virtual void ring() noexcept = 0;
  /// Returns the tags that are ready now. If there are more, it stays readable.
  /// @realtime one system call; one more after ring()
  [[nodiscard]] virtual std::span<std::uint64_t> take(std::span<std::uint64_t> ready) noexcept = 0;

  static constexpr std::uint64_t kTagMax = ~std::uint64_t{2};
};

}  // namespace rtpm::transport
