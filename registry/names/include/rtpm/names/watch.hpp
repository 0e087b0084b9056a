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

/// Names that a watch may list.
inline constexpr std::size_t kWatchedNameCountMax = 512;

/// Which names a watch is about; all conditions that are given must hold.
struct WatchConfig {
  std::string directory{};                      ///< A name, and all below it; empty: any.
  std::vector<std::string> names{};             ///< At most kWatchedNameCountMax; empty: any.
  std::string interface {};                     ///< Empty: any.
  std::string predicate{};                      ///< As NameQuery::predicate; empty: any.
  Duration deadline = std::chrono::seconds{1};  ///< Of start().
};

/// A change of a name, as the watch's conditions see it.
struct NameChange {
  enum class Kind : std::uint8_t {
    kBound,    ///< Is bound, or fits now.
    kChanged,  ///< Leads elsewhere, has another holder, or other properties.
    kGone,     ///< Is not bound any more, or does not fit any more; with its last entry.
  };
  Kind kind = Kind::kBound;
  NameEntry entry{};
};

/// What a watch calls, each on its thread "rtpm-watch"; empty ones are left out.
struct WatchHandlers {
  /// First one kBound for each name that is bound, then changes in their order.
  std::function<void(const NameChange&)> on_change{};
  /// The names that are bound have all been told.
  std::function<void()> on_state{};
  /// The registry has had no word for that long from the storage that it shares with others; 0: it
  /// is up to date again.
  std::function<void(Duration stale_for)> on_stale{};
  /// The registry is not reached, cut this watch off as too slow, or is there again; a sentence.
  /// What changed meanwhile is told as changes, of which only the last of each name.
  std::function<void(std::string_view sentence)> on_notice{};
};

/// Follows names at the registry. It reconnects by itself and resumes where it was, or compares
/// with the full state where the registry has forgotten that.
///
/// Without the URL of a registry it follows the name services of a scope, as Directory finds them,
/// and looks for further ones every quarter of a second, on the LAN every 5 s. A name that moves
/// from one to another and leads where it did has not changed. The names of a server that ended are
/// gone at once, those of a registry when their lease of 2 s would have ended.
/// @ownership refers to its node, which must outlive it
/// @threads  start and end from one thread; the rest any
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

  /// Watches other names from soon on; for those that stay, nothing is lost.
  void set_names(std::vector<std::string> names);
  /// Of the last change that was told.
  [[nodiscard]] std::uint64_t revision() const noexcept;
  /// How often the full state was compared, the first time included.
  [[nodiscard]] std::uint64_t state_count() const noexcept;
  /// Whether it is connected.
  [[nodiscard]] bool is_connected() const noexcept;

  class Impl;

 private:
  explicit NameWatch(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::names
