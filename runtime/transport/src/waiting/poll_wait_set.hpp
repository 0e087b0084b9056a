#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "bsd_sockets.hpp"
#include "os/doorbell.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/transport/wait_set.hpp"

namespace rtpm::transport {

/// Waits with poll(2), which costs time in proportion to the number of sources. Takes no
/// edge-triggered ones.
/// @realtime alloc-free, one system call per wait where the system polls to the nanosecond; one
///           more if the doorbell rang
class PollWaitSet : public WaitSet {
 public:
  /// @param source_count_max  its capacity, not counting the doorbell
  PollWaitSet(std::size_t source_count_max, os::Doorbell doorbell);

  [[nodiscard]] bool add(int descriptor, SourceTag tag, Trigger trigger) noexcept override;
  void remove(int descriptor) noexcept override;
  [[nodiscard]] std::size_t wait(MonotonicTime until, std::span<SourceTag> ready,
                                 WaitLock* held = nullptr) noexcept override;
  void ring() noexcept override;

 protected:
  class BlockScope;
  struct Source {
    int descriptor = -1;
    Trigger trigger = Trigger::kLevel;
    SourceTag tag{};
  };

  [[nodiscard]] std::vector<Source>& sources() noexcept { return sources_; }
  [[nodiscard]] std::size_t source_count() const noexcept { return sources_.size(); }
  /// Whether the set has room for the descriptor, which is open.
  [[nodiscard]] bool has_room_for(int descriptor) const noexcept;
  [[nodiscard]] bool is_blocked() const noexcept { return is_blocked_; }
  [[nodiscard]] std::vector<Source>::iterator find(int descriptor) noexcept;
  virtual void erase(std::vector<Source>::iterator source) noexcept;

  /// Whether the last wait reported the doorbell.
  [[nodiscard]] bool was_rung() const noexcept { return was_rung_; }
  void begin_wait() noexcept { was_rung_ = false; }
  void count_ring() noexcept { ring_count_.fetch_add(1, std::memory_order_seq_cst); }
  [[nodiscard]] os::Doorbell& doorbell() noexcept { return doorbell_; }
  /// Whether the readable doorbell means a ring that is not reported yet.
  [[nodiscard]] bool has_rung() noexcept;
  /// Whether the doorbell has rung since the last query.
  [[nodiscard]] bool take_rings() noexcept;

 private:
  [[nodiscard]] bool is_present(const pollfd& entry, SourceTag tag) noexcept;

  os::Doorbell doorbell_;
  std::size_t source_count_max_;
  std::vector<Source> sources_;
  // The doorbell and the sources, as the wait in progress polls them.
  std::vector<pollfd> entries_{};
  std::vector<SourceTag> tags_{};
  std::size_t next_ = 0;     ///< The entry that the next wait reports first.
  bool is_blocked_ = false;  ///< A wait that has released its lock is in progress.
  bool was_rung_ = false;
  std::uint64_t heard_count_ = 0;
  alignas(64) std::atomic<std::uint64_t> ring_count_{0};
};

/// Covers the time in which a wait may block: releases the lock, and counts the thread as asleep.
/// Keeps errno.
class PollWaitSet::BlockScope {
 public:
  BlockScope(PollWaitSet& set, MonotonicTime until, WaitLock* held) noexcept;
  BlockScope(const BlockScope&) = delete;
  BlockScope& operator=(const BlockScope&) = delete;
  ~BlockScope();

 private:
  PollWaitSet& set_;
  WaitLock* held_;
  std::optional<rt::AsleepScope> asleep_;
};

}  // namespace rtpm::transport
