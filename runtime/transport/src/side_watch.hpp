#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "rtpm/transport/socket.hpp"

struct io_uring_cqe;
struct io_uring_params;
struct io_uring_sqe;

namespace rtpm::transport {

/// Has what comes on some descriptors end a receive in which the thread blocks, though that receive
/// is from none of them: it fails with EINTR. So a thread waits for several sources by a plain
/// receive from the one that is likely, and who sends there is answered a system call sooner.
///
/// The descriptors are polled by io_uring, which tells a thread what it polled for by having it
/// leave whatever it waits in. No signal is involved, and no system call while nothing comes. What
/// comes between has_news() and the receive ends that at once, but for one case: a clock's
/// interrupt in the few nanoseconds between the two delivers it unseen. The receive is to have a
/// limit of its own therefore (limit_blocking()).
///
/// Threads: begin(), has_news() and end() on the one that receives.
/// Source: io_uring_setup(2), IORING_SETUP_COOP_TASKRUN.
class SideWatch {
 public:
  static constexpr std::size_t kCountMax = 2;

  /// None where the system has no io_uring (before Linux 5.5) or forbids it, as containers' seccomp
  /// profiles and kernel.io_uring_disabled do.   Set-up only.
  [[nodiscard]] static std::unique_ptr<SideWatch> open();

  SideWatch() = default;
  SideWatch(const SideWatch&) = delete;
  SideWatch& operator=(const SideWatch&) = delete;
  ~SideWatch();

  /// False once the system refused something.
  [[nodiscard]] bool is_open() const noexcept { return ring_.is_open(); }
  [[nodiscard]] bool is_on() const noexcept { return is_on_; }
  /// Watches up to kCountMax descriptors, once: after has_news() it takes an end() and another
  /// begin(). False if the system refuses, after which it isn't open.
  /// RT: alloc-free, one syscall.
  [[nodiscard]] bool begin(std::span<const int> descriptors) noexcept;
  /// Whether something came, or was there already.   RT: alloc-free, no syscall.
  [[nodiscard]] bool has_news() noexcept;
  /// Watches no more; the descriptors can be closed. One more wait may fail with EINTR.
  /// RT: alloc-free, one syscall.
  void end() noexcept;

 private:
  /// A ring that is shared with the kernel: both count on for ever, and take the remainder.
  struct Indices {
    std::uint32_t* head = nullptr;
    std::uint32_t* tail = nullptr;
    std::uint32_t mask = 0;
  };

  [[nodiscard]] bool map(const io_uring_params& layout) noexcept;
  [[nodiscard]] io_uring_sqe& next_entry() noexcept;
  [[nodiscard]] bool submit(std::uint32_t count) noexcept;
  [[nodiscard]] std::uint64_t tag_of(std::size_t index) const noexcept {
    return watch_count_ * kCountMax + index;
  }

  Descriptor ring_;
  std::span<std::byte> ring_memory_;  ///< Mapped until this ends, whether it is open or not.
  std::span<std::byte> entry_memory_;
  Indices submitted_;
  Indices completed_;
  io_uring_sqe* entries_ = nullptr;
  io_uring_cqe* completions_ = nullptr;
  std::uint64_t watch_count_ = 0;  ///< Tells what one watch saw from what an earlier one did.
  std::size_t descriptor_count_ = 0;
  bool is_on_ = false;
  bool has_news_ = false;
};

}  // namespace rtpm::transport
