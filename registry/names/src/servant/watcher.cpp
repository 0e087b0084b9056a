#include "servant/watcher.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/limits.hpp"
#include "servant/entries.hpp"

namespace rtpm::names {
namespace {

// One slot stays free for the item that cuts the watcher off.
constexpr std::uint32_t kWaitingMax = wire::kStreamWindow - 2;
// Further changes go into the next item, so that most items fit a datagram.
constexpr std::size_t kItemSizeFull = 800;
// The work done for one watcher before the next one's turn.
constexpr int kItemCountPerTurn = 8;
constexpr std::size_t kLookedAtPerItem = 256;

bool is_stale(Duration stale) noexcept {
  return stale > Duration{0};
}

}  // namespace

Watcher::Watcher(rpc::TableWriter<WatchItem> writer, WatchFilter filter,
                 const std::uint64_t& history, std::optional<std::uint64_t> after,
                 const Store& store, std::uint64_t host)
    : writer_(std::move(writer)),
      filter_(std::move(filter)),
      history_(history),
      host_(host),
      is_in_state_(!after),
      restart_count_(store.log().restart_count()),
      began_(rt::now()),
      position_(after.value_or(store.log().revision())) {}

void Watcher::begin_state(const Store& store) {
  is_in_state_ = true;
  state_cursor_.clear();
  restart_count_ = store.log().restart_count();
  position_ = store.log().revision();
}

bool Watcher::has_capacity() const noexcept {
  return writer_.waiting_count() < kWaitingMax;
}

Watcher::Outcome Watcher::pump(const Store& store, const Storage& storage, MonotonicTime now) {
  for (int i = 0; i < kItemCountPerTurn; ++i) {
    if (!writer_.is_awaited()) return Outcome::kGone;
    const ChangeLog& log = store.log();
    // The revision to resume after may still arrive, unless the registry has everything that was
    // stored when the watch started.
    const bool waits_in_vain = position_ > log.revision() && storage.current_as_of() >= began_;
    if (log.restart_count() != restart_count_ || waits_in_vain) begin_state(store);
    const bool is_stuck = !has_capacity();
    const Duration stale = storage.stale_for(now);
    const bool is_forgotten = !log.reaches(position_) && position_ <= log.revision();
    const bool is_late = is_stuck && log.count_after(position_) > store.limits().watch_backlog_max;
    if (is_forgotten || is_late) {
      begin_item();
      static_cast<void>(send(WatchPhase::CutOff, stale));
      writer_.finish();
      return Outcome::kTooSlow;
    }
    if (is_stuck) return Outcome::kBacklog;
    begin_item();
    if (is_in_state_) {
      const bool is_whole = fill_state(store, now);
      if (!send(is_whole ? WatchPhase::StateEnd : WatchPhase::State, stale)) {
        return Outcome::kGone;
      }
      is_in_state_ = !is_whole;
    } else {
      const bool is_whole = fill_changes(store, now);
      const bool is_needed = !changes_.empty() || is_welcome_due_ || is_stale_ != is_stale(stale);
      if (is_needed && !send(WatchPhase::Changes, stale)) return Outcome::kGone;
      if (is_whole) return Outcome::kDone;
    }
    is_welcome_due_ = false;
  }
  return Outcome::kMore;
}

void Watcher::begin_item() {
  builder_.Clear();
  changes_.clear();
}

// Returns whether this completes the state. A record that changed since the watch started is sent
// in its current form; its change, which follows, then has no later revision.
bool Watcher::fill_state(const Store& store, MonotonicTime now) {
  std::size_t looked_at = 0;
  const bool is_whole =
      store.for_each_after(state_cursor_, filter_.directory, [&](const Record& record) {
        state_cursor_ = record.name;
        if (filter_.accepts(record)) add(ChangeKind::Bound, record, record.change, now);
        return builder_.GetSize() < kItemSizeFull && ++looked_at < kLookedAtPerItem;
      });
  return is_whole;
}

// Returns whether these are all changes so far.
bool Watcher::fill_changes(const Store& store, MonotonicTime now) {
  std::size_t looked_at = 0;
  while (const LoggedChange* const change = store.log().after(position_)) {
    if (builder_.GetSize() >= kItemSizeFull || ++looked_at > kLookedAtPerItem) return false;
    position_ = change->revision;
    const bool was_in = change->before && filter_.accepts(*change->before);
    const bool is_in = change->after && filter_.accepts(*change->after);
    if (is_in) {
      add(was_in ? ChangeKind::Changed : ChangeKind::Bound, *change->after, position_, now);
    } else if (was_in) {
      add(ChangeKind::Gone, *change->before, position_, now);
    }
  }
  return true;
}

void Watcher::add(ChangeKind kind, const Record& record, std::uint64_t revision,
                  MonotonicTime now) {
  const auto entry = write_entry(builder_, record, now, host_, EntryDetail::kAll);
  changes_.push_back(CreateChange(builder_, kind, entry, revision));
}

bool Watcher::send(WatchPhase phase, Duration stale) {
  is_stale_ = is_stale(stale);
  const Answer answer = answer_of(names::Outcome::kDone);
  const auto changes = builder_.CreateVector(changes_);
  builder_.Finish(
      CreateWatchItem(builder_, &answer, phase, history_, position_, changes, 0, 0, ns_of(stale)));
  return writer_.write(builder_).has_value();
}

void refuse_watch(rpc::TableWriter<WatchItem>& writer, Outcome outcome,
                  const predicate::TextError& error) {
  flatbuffers::FlatBufferBuilder builder;
  const Answer answer = answer_of(outcome);
  const auto why = builder.CreateString(error.what);
  builder.Finish(CreateWatchItem(builder, &answer, WatchPhase::CutOff, 0, 0, 0,
                                 static_cast<std::uint32_t>(error.offset), why));
  static_cast<void>(writer.write(builder));
  writer.finish();
}

}  // namespace rtpm::names
