#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/transport/wait_set.hpp"

struct pollfd;

namespace rtpm::transport {

/// Waits with ppoll(2) for few sources, and with epoll for many or edge-triggered ones. A source in
/// epoll costs a callback per frame in or out, even without a wait: a tenth of a datagram's cost.
/// @realtime alloc-free, one system call per wait; one more if the doorbell rang
class PolledWaitSet : public WaitSet {
 public:
  static constexpr std::size_t kFewMax = 5;

  /// @param source_count_max  its capacity, not counting the doorbell
  /// @errors  no descriptor left; the system has no epoll_pwait2
  [[nodiscard]] static expected<std::unique_ptr<PolledWaitSet>, SetupError> open(
      std::size_t source_count_max);

  [[nodiscard]] bool add(int descriptor, SourceTag tag, Trigger trigger) noexcept override;
  void remove(int descriptor) noexcept override;
  [[nodiscard]] std::size_t wait(MonotonicTime until, std::span<SourceTag> ready,
                                 WaitLock* held = nullptr) noexcept override;
  void ring() noexcept override;

 protected:
  explicit PolledWaitSet(std::size_t source_count_max);
  [[nodiscard]] expected<void, SetupError> open_descriptors();

  [[nodiscard]] std::size_t source_count() const noexcept { return sources_.size(); }
  /// Whether the last wait reported the doorbell.
  [[nodiscard]] bool was_rung() const noexcept { return was_rung_; }
  void count_ring() noexcept { ring_count_.fetch_add(1, std::memory_order_seq_cst); }
  void signal_doorbell() noexcept;
  void clear_doorbell() noexcept;
  /// Whether the doorbell has rung since the last query.
  [[nodiscard]] bool take_rings() noexcept;

 private:
  class BlockScope;
  struct Source {
    int descriptor = -1;
    Trigger trigger = Trigger::kLevel;
    SourceTag tag{};
  };

  [[nodiscard]] std::size_t wait_for_few(MonotonicTime until, std::span<SourceTag> ready,
                                         WaitLock* held) noexcept;
  [[nodiscard]] std::size_t wait_for_many(MonotonicTime until, std::span<SourceTag> ready,
                                          WaitLock* held) noexcept;
  [[nodiscard]] bool has_rung() noexcept;
  [[nodiscard]] bool is_present(const pollfd& entry, SourceTag tag) noexcept;
  [[nodiscard]] bool enter_epoll() noexcept;
  void leave_epoll() noexcept;
  [[nodiscard]] bool register_source(const Source& source) noexcept;
  [[nodiscard]] std::vector<Source>::iterator find(int descriptor) noexcept;
  void erase(std::vector<Source>::iterator source) noexcept;

  Descriptor epoll_;
  Descriptor doorbell_;
  std::size_t source_count_max_;
  std::vector<Source> sources_;
  std::size_t edge_count_ = 0;
  std::size_t next_few_ = 0;  ///< The entry that the next ppoll reports first.
  bool is_in_epoll_ = false;  ///< Either all sources are in epoll, or none is.
  bool is_blocked_ = false;   ///< A wait that has released its lock is in progress.
  bool was_rung_ = false;
  std::uint64_t heard_count_ = 0;
  alignas(64) std::atomic<std::uint64_t> ring_count_{0};
};

}  // namespace rtpm::transport
