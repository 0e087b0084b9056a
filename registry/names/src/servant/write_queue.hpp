#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::names {

/// Makes changes, which wait for the storage, on time-shared threads "rtpm-names-w".
/// @threads  any
class WriteQueue {
 public:
  static constexpr std::size_t kThreadCount = 4;
  /// The most waiting or running changes: in total, per remote host, and for the registry's own
  /// host.
  static constexpr std::size_t kCountMax = 256;
  static constexpr std::size_t kCountPerHostMax = 64;
  static constexpr std::size_t kCountOwnHostMax = 192;

  WriteQueue() = default;
  WriteQueue(const WriteQueue&) = delete;
  WriteQueue& operator=(const WriteQueue&) = delete;
  ~WriteQueue() { stop(); }

  [[nodiscard]] expected<void, SetupError> start();
  [[nodiscard]] bool is_running() const noexcept { return !threads_.empty(); }
  /// Waits for running changes, and drops the rest.
  void stop();
  /// Reserves capacity for a change by `host`; false if there is none. Each add() uses one
  /// reservation.
  [[nodiscard]] bool reserve(std::uint64_t host);
  void release(std::uint64_t host);
  /// Runs `change` on one of the threads, then releases its capacity.
  void add(std::uint64_t host, std::function<void()> change);

  [[nodiscard]] std::size_t count() const;
  /// How often there was no capacity.
  [[nodiscard]] std::uint64_t overload_count() const;

 private:
  struct Waiting {
    std::uint64_t host = 0;
    std::function<void()> change{};
  };
  void run();

  mutable std::mutex mutex_;  ///< Held for a few instructions only. Guards the rest.
  std::condition_variable waking_{};
  std::deque<Waiting> waiting_{};
  std::map<std::uint64_t, std::size_t> count_of_host_{};
  std::size_t count_ = 0;
  std::uint64_t overload_count_ = 0;
  bool is_stopping_ = false;
  std::vector<rt::Thread> threads_{};
};

}  // namespace rtpm::names
