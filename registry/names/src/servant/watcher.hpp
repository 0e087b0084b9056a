#pragma once

#include <cstdint>
#include <string>

#include "model/idl.hpp"
#include "model/watch_filter.hpp"
#include "rtpm/base/time.hpp"
#include "store/change_log.hpp"
#include "store/store.hpp"

namespace rtpm::names {

/// The registry's end of a watch: its stream, and its progress.
class Watcher {
 public:
  /// Result of pump().
  enum class Outcome : std::uint8_t {
    kDone,     ///< Everything was sent.
    kMore,     ///< There is more to send at once.
    kBacklog,  ///< The watcher accepts no more for now.
    kGone,     ///< The watcher is gone.
    kTooSlow,  ///< The watcher was cut off.
  };

  /// @param history  the number of the registry's current history; must outlive this
  /// @param after    the revision to resume after; if nullopt, the state is sent first
  Watcher(rpc::TableWriter<WatchItem> writer, WatchFilter filter, const std::uint64_t& history,
          std::optional<std::uint64_t> after, const Store& store, std::uint64_t host);

  /// Sends some items. Cuts off a watcher that accepts no items while more changes are waiting than
  /// the limits allow. `storage` is the storage of `store`.
  [[nodiscard]] Outcome pump(const Store& store, const Storage& storage, MonotonicTime now);

  [[nodiscard]] std::uint64_t host() const noexcept { return host_; }

 private:
  [[nodiscard]] bool has_capacity() const noexcept;
  [[nodiscard]] bool fill_state(const Store& store, MonotonicTime now);
  [[nodiscard]] bool fill_changes(const Store& store, MonotonicTime now);
  void add(ChangeKind kind, const Record& record, std::uint64_t revision, MonotonicTime now);
  void begin_item();
  [[nodiscard]] bool send(WatchPhase phase, Duration stale);
  void begin_state(const Store& store);

  rpc::TableWriter<WatchItem> writer_;
  WatchFilter filter_;
  const std::uint64_t& history_;
  std::uint64_t host_;
  bool is_in_state_;
  bool is_welcome_due_ = true;   ///< The first item is sent even without changes.
  std::string state_cursor_{};   ///< The last visited name of the state.
  bool is_stale_ = false;        ///< Value in the last item.
  std::uint64_t restart_count_;  ///< The log's count when the state was last started.
  MonotonicTime began_;          ///< When the watch started.
  std::uint64_t position_;       ///< Every change up to this revision was sent, or is in the state.
  flatbuffers::FlatBufferBuilder builder_{};
  std::vector<flatbuffers::Offset<Change>> changes_{};
};

/// Tells the caller why its watch was refused.
void refuse_watch(rpc::TableWriter<WatchItem>& writer, Outcome outcome,
                  const predicate::TextError& error = {});

}  // namespace rtpm::names
