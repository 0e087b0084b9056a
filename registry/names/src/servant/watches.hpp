#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "model/idl.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"
#include "servant/watcher.hpp"
#include "store/store.hpp"

namespace rtpm::names {

/// The watchers of a registry. A time-shared thread "rtpm-watches", which starts with the first
/// watcher, sends them changes and ends leases on time.
/// @threads  wake(): any; the rest as stated
class Watches {
 public:
  /// `mutex` guards `store`, which has the names of `storage`.
  Watches(rt::PiMutex& mutex, Store& store, const Storage& storage, std::uint64_t history) noexcept
      : mutex_(mutex), store_(store), storage_(storage), history_(history) {}
  Watches(const Watches&) = delete;
  Watches& operator=(const Watches&) = delete;
  ~Watches();

  /// Accepts a caller's stream, or refuses it there. Requires the mutex.
  /// @param caller  sees only what its grants allow; everything if null
  void add(const WatchRequest& request, rpc::TableWriter<WatchItem> writer, std::uint64_t host,
           std::shared_ptr<const rpc::Caller> caller = nullptr);
  /// Starts a new history of revisions. Watchers receive its number; a client that resumes with an
  /// earlier number gets the complete state. Requires the mutex.
  void begin_history(std::uint64_t history) noexcept { history_ = history; }
  /// Call it after a change.
  void wake() noexcept {
    if (thread_.is_running()) bell_.post();
  }

  /// The number of watchers. Requires the mutex.
  [[nodiscard]] std::size_t count() const noexcept { return watchers_.size(); }
  [[nodiscard]] std::uint64_t cut_off_count() const noexcept { return cut_off_count_; }

 private:
  void run();
  [[nodiscard]] MonotonicTime turn();
  [[nodiscard]] bool is_full(std::uint64_t host) const noexcept;

  rt::PiMutex& mutex_;
  Store& store_;
  const Storage& storage_;
  std::uint64_t history_;
  std::vector<std::unique_ptr<Watcher>> watchers_{};
  std::uint64_t cut_off_count_ = 0;
  bool is_stopping_ = false;
  rt::Semaphore bell_;
  rt::Thread thread_;
};

}  // namespace rtpm::names
