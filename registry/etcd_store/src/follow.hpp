#pragma once

#include <atomic>
#include <cstdint>
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
/// Every half second it reads at the same endpoint, through the leader, which changes the watch
/// must have told: so what a registry has is known to be current. Where that fails it goes on at
/// the next endpoint, behind the last revision, once it has seen that the cluster still had at that
/// revision what it has told: a restored one gives other changes the same revisions again.
/// @threads  start and stop from one
class Follow {
 public:
  Follow(Gateway& gateway, const Keys& keys, KnownNames& known) noexcept
      : gateway_(gateway), keys_(keys), known_(known) {}
  Follow(const Follow&) = delete;
  Follow& operator=(const Follow&) = delete;
  ~Follow() { stop(); }

  /// Tells `follower` what comes behind `revision`.
  [[nodiscard]] expected<void, SetupError> start(names::SharedStorage::Follower& follower,
                                                 std::uint64_t revision);
  void stop() noexcept;

 private:
  /// What a read through the leader has shown.
  struct Probe {
    MonotonicTime begun{};
    std::uint64_t last_change = 0;  ///< Of those that are there; of what has gone nothing is known.
    std::uint64_t count = 0;        ///< Of names.
    std::uint64_t revision = 0;     ///< That the watch had told then.
    bool is_met = false;
    int unmet_count = 0;  ///< How many before found the same, and the watch told nothing.
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
  /// Whether revisions that were told stay what they are.
  enum class History : std::uint8_t { kSame, kReplaced };
  [[nodiscard]] std::string read_again(History history, std::string why);
  void end_unused_leases(std::size_t endpoint);
  void note_reached();
  void note_trouble(std::size_t endpoint, const std::string& why);
  void pause(Duration duration);

  Gateway& gateway_;
  const Keys& keys_;
  KnownNames& known_;
  names::SharedStorage::Follower* follower_ = nullptr;
  HttpStream stream_{};
  std::uint64_t revision_ = 0;  ///< Of the last change that was told.
  std::vector<names::SharedChange> fragments_{};
  bool is_created_ = false;
  bool is_to_check_history_ = true;  ///< At the beginning, and when a watch has broken.
  bool was_read_again_ = false;      ///< And that is why the watch ended.
  std::optional<Probe> probe_{};
  bool is_told_ = false;           ///< That it is not reached.
  std::size_t failure_count_ = 0;  ///< One after the other.
  rt::Thread thread_{};
};

}  // namespace rtpm::etcd_store
