#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/socket.hpp"
#include "waiting/poll_wait_set.hpp"

namespace rtpm::transport {

/// Waits with ppoll(2) for few sources, and with epoll for many or edge-triggered ones. A source in
/// epoll costs a callback per frame in or out, even without a wait: a tenth of a datagram's cost.
/// @realtime alloc-free, one system call per wait; one more if the doorbell rang
class EpollWaitSet : public PollWaitSet {
 public:
  static constexpr std::size_t kFewMax = 5;

  using PollWaitSet::PollWaitSet;
  /// Call it once, before anything else.
  /// @errors  no descriptor left; the system has no epoll_pwait2
  [[nodiscard]] expected<void, SetupError> open_epoll();

  [[nodiscard]] bool add(int descriptor, SourceTag tag, Trigger trigger) noexcept override;
  void remove(int descriptor) noexcept override;
  [[nodiscard]] std::size_t wait(MonotonicTime until, std::span<SourceTag> ready,
                                 WaitLock* held = nullptr) noexcept override;

 private:
  [[nodiscard]] std::size_t wait_for_many(MonotonicTime until, std::span<SourceTag> ready,
                                          WaitLock* held) noexcept;
  [[nodiscard]] bool enter_epoll() noexcept;
  void leave_epoll() noexcept;
  [[nodiscard]] bool register_source(const Source& source) noexcept;
  void erase(std::vector<Source>::iterator source) noexcept override;

  Descriptor epoll_;
  std::size_t edge_count_ = 0;
  bool is_in_epoll_ = false;  ///< Either all sources are in epoll, or none is.
};

}  // namespace rtpm::transport
