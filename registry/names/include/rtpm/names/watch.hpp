#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// How many names a watch may list.
inline constexpr std::size_t kWatchedNameCountMax = 512;

/// Selects the names of a watch: those that meet all given conditions.
struct WatchConfig {
  std::string directory{};                      ///< A name, with all names below it; any if empty.
  std::vector<std::string> names{};             ///< At most kWatchedNameCountMax; any if empty.
  std::string interface {};                     ///< Any if empty.
  std::string predicate{};                      ///< See NameQuery::predicate; any if empty.
  Duration deadline = std::chrono::seconds{1};  ///< Deadline of start().
};

/// A change of a name that meets the watch's conditions.
struct NameChange {
  enum class Kind : std::uint8_t {
    kBound,    ///< Is bound, or matches now.
    kChanged,  ///< Leads elsewhere, has another holder, or other properties.
    kGone,     ///< Is no longer bound, or no longer matches; with its last entry.
  };
  Kind kind = Kind::kBound;
  NameEntry entry{};
};

/// The handlers of a watch, called on its thread "rtpm-watch"; empty ones are skipped.
struct WatchHandlers {
  /// First receives one kBound for each bound name, then changes in order.
  std::function<void(const NameChange&)> on_change{};
  /// Called when all bound names have been reported.
  std::function<void()> on_state{};
  /// The registry has not heard for that long from the storage that it shares with other
  /// registries; 0 when it is current again.
  std::function<void(Duration stale_for)> on_stale{};
  /// The registry is unreachable, is reachable again, or cut off this watch as too slow; a
  /// sentence. After that, on_change receives only the last missed change of each name.
  std::function<void(std::string_view sentence)> on_notice{};
};

/// Follows names at the registry. It reconnects automatically and resumes at its revision or, if
/// the registry no longer has that, compares with the full state.
///
/// Without a registry's URL it follows the name services of a scope, as Directory finds them, and
/// searches for new ones every quarter of a second, on the LAN every 5 s. A name that moves between
/// services and keeps its URL counts as unchanged. When a server ends, its own names are gone at
/// once; a registry's names are gone when their lease of 2 s would have ended.
/// @ownership refers to its node, which must outlive it
/// @threads  start and destroy on one thread; the rest: any
class NameWatch {
 public:
  /// @realtime set-up only; blocks at most config.deadline
  /// @errors   no registry answers at the URL; kBadPredicate with text_error; kTooManyWatches;
  /// kBadName
  [[nodiscard]] static expected<std::unique_ptr<NameWatch>, DirectoryError> start(
      rpc::Node& node, std::string where, WatchConfig config, WatchHandlers handlers);

  NameWatch(const NameWatch&) = delete;
  NameWatch& operator=(const NameWatch&) = delete;
  /// Waits for a running handler.
  ~NameWatch();

  /// Changes the watched names, shortly after the call; names that stay selected miss no change.
  void set_names(std::vector<std::string> names);
  /// Revision of the last change that was reported.
  [[nodiscard]] std::uint64_t revision() const noexcept;
  /// How often the full state was compared, including the first time.
  [[nodiscard]] std::uint64_t state_count() const noexcept;
  /// Whether the registry is connected.
  [[nodiscard]] bool is_connected() const noexcept;

  class Impl;

 private:
  explicit NameWatch(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::names
