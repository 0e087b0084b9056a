#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "content.hpp"
#include "gateway.hpp"
#include "http.hpp"
#include "known_names.hpp"
#include "rtpm/names/storage.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::etcd_store {

/// Follows the names of a cluster by a watch at one endpoint, on a time-shared thread "rtpm-etcd".
/// Every half second it reads, through the leader at the same endpoint, which changes the watch
/// must have reported: this proves that a registry's content is current. If that fails, it
/// continues at the next endpoint after the last revision. Before, it checks that the cluster's
/// content at that revision matches the reported one: a restored cluster reuses revisions for other
/// changes.
/// @threads  start and stop: one; the rest: any
class Follow {
 public:
  Follow(Gateway& gateway, const Keys& keys, KnownNames& known) noexcept
      : gateway_(gateway), keys_(keys), known_(known) {}
  Follow(const Follow&) = delete;
  Follow& operator=(const Follow&) = delete;
  ~Follow() { stop(); }

  /// Reports the changes after `revision` to `follower`.
  [[nodiscard]] expected<void, SetupError> start(names::Storage::Follower& follower,
                                                 std::uint64_t revision);
  void stop() noexcept;
  /// The registry that follows; null before start().
  [[nodiscard]] names::Storage::Follower* follower() const noexcept { return follower_; }
  /// Waits until the change of `revision` is reported; false if `deadline` passes or stop() is
  /// called first.
  [[nodiscard]] bool wait_for(std::uint64_t revision, MonotonicTime deadline);
  /// Whether the change of `revision` was reported.
  [[nodiscard]] bool has_reported(std::uint64_t revision);
  /// The time up to which all stored changes have been reported.
  [[nodiscard]] MonotonicTime current_as_of() const noexcept { return current_as_of_; }
  void set_current(MonotonicTime as_of) noexcept { current_as_of_ = as_of; }

 private:
  /// The result of a read through the leader.
  struct Probe {
    MonotonicTime begun{};
    /// The last change of existing names; removed names are not visible.
    std::uint64_t last_change = 0;
    std::uint64_t count = 0;     ///< Number of names.
    std::uint64_t revision = 0;  ///< The last revision that the watch had reported by then.
    bool is_met = false;
    /// How many earlier probes found the same while the watch reported nothing.
    int unmet_count = 0;
  };

  void run();
  [[nodiscard]] std::string follow_at(std::size_t endpoint);
  [[nodiscard]] std::optional<std::string> take(std::size_t endpoint, const std::string& line);
  [[nodiscard]] std::optional<std::string> take_events(std::size_t endpoint, const Json& events);
  [[nodiscard]] expected<bool, GatewayError> has_lapsed(std::size_t endpoint,
                                                        const std::string& name,
                                                        std::uint64_t revision);
  [[nodiscard]] std::optional<std::string> probe(std::size_t endpoint);
  void check_probe();
  [[nodiscard]] std::optional<std::string> check_history();
  /// Whether reported revisions remain valid.
  enum class History : std::uint8_t { kSame, kReplaced };
  [[nodiscard]] std::string read_again(History history, std::string why);
  void end_unused_leases(std::size_t endpoint);
  void note_reported();
  void note_reached();
  void note_trouble(std::size_t endpoint, const std::string& why);
  void pause(Duration duration);

  Gateway& gateway_;
  const Keys& keys_;
  KnownNames& known_;
  names::Storage::Follower* follower_ = nullptr;
  HttpStream stream_{};
  std::uint64_t revision_ = 0;  ///< The last change that was reported; for the thread only.
  std::vector<names::ReportedChange> fragments_{};
  bool is_created_ = false;
  bool is_to_check_history_ = true;  ///< Set initially, and when a watch has broken.
  bool was_read_again_ = false;      ///< The watch ended because everything was read again.
  std::optional<Probe> probe_{};
  bool is_told_ = false;           ///< etcd's unreachability was reported.
  std::size_t failure_count_ = 0;  ///< Consecutive failures.
  std::atomic<MonotonicTime> current_as_of_{};
  std::mutex mutex_;  ///< Plain: no real-time thread locks it. Guards the number below.
  std::condition_variable reporting_{};
  std::uint64_t reported_ = 0;  ///< The same revision as `revision_`.
  rt::Thread thread_{};
};

}  // namespace rtpm::etcd_store
