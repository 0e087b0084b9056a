#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "rtpm/base/log_limit.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/storage.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "store.hpp"
#include "watches.hpp"

namespace rtpm::names {

/// A registry's copy of the names in a shared storage.
/// @threads  the storage's; wait_for() and trouble() any
class Replica final : public SharedStorage::Follower {
 public:
  /// `mutex` guards `store`, which is complete up to `revision`. `report` receives sentences for
  /// the log, a few per second, on the storage's thread.
  Replica(rt::PiMutex& mutex, Store& store, Watches& watches, std::uint64_t revision,
          std::function<void(std::string_view)> report)
      : mutex_(mutex),
        store_(store),
        watches_(watches),
        report_(std::move(report)),
        applied_(revision) {}

  void on_changes(std::vector<SharedChange> changes) override;
  void on_restart(std::vector<StoredName> names, std::uint64_t revision, bool is_replaced) override;
  void on_current(MonotonicTime as_of) override;
  void on_trouble(const std::string& sentence) override;

  /// Waits until the store has the change of `revision`; false if not by `deadline`. Call it
  /// without the mutex locked.
  [[nodiscard]] bool wait_for(std::uint64_t revision, MonotonicTime deadline);
  /// The last trouble in words; empty if there is none.
  [[nodiscard]] std::string trouble() const;

 private:
  void reach(std::uint64_t revision);

  rt::PiMutex& mutex_;
  Store& store_;
  Watches& watches_;
  std::function<void(std::string_view)> report_;
  mutable std::mutex progress_mutex_;  ///< Plain: no real-time thread locks it. Guards the rest.
  std::condition_variable progress_{};
  std::uint64_t applied_;
  std::string trouble_{};
  LogLimit log_{{.burst = 4}};
};

}  // namespace rtpm::names
