#include "servant/watches.hpp"

#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>

#include "model/name.hpp"
#include "model/query.hpp"
#include "rtpm/names/watch.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

// How often a full watcher is retried: nothing reports that it has taken items.
constexpr Duration kBacklogInterval = 10ms;
// How soon a silently disconnected watcher is noticed.
constexpr Duration kLookInterval = 1s;

// The directory must be a name.
std::optional<Outcome> check(const WatchRequest& request) {
  const std::string_view directory = view_of(request.directory());
  if (!directory.empty() && first_bad_component(directory)) return Outcome::kBadName;
  if (request.names() == nullptr) return std::nullopt;
  if (request.names()->size() > kWatchedNameCountMax) return Outcome::kBadName;
  for (const auto* name : *request.names()) {
    if (first_bad_component(name->string_view())) return Outcome::kBadName;
  }
  return std::nullopt;
}

}  // namespace

Watches::~Watches() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  bell_.post();
  if (thread_.is_running()) thread_.join();
}

bool Watches::is_full(std::uint64_t host) const noexcept {
  const Limits& limits = store_.limits();
  const auto here = static_cast<std::size_t>(std::ranges::count_if(
      watchers_, [&](const auto& watcher) { return watcher->host() == host; }));
  const bool is_own = is_own_host(host);
  // Local callers leave some watches to other hosts, as with sessions.
  const std::size_t share = limits.watch_count_max - limits.watch_count_max / 4;
  return watchers_.size() >= limits.watch_count_max ||
         here >= (is_own ? share : limits.watch_count_per_host_max);
}

void Watches::add(const WatchRequest& request, rpc::TableWriter<WatchItem> writer,
                  std::uint64_t host, std::shared_ptr<const rpc::Caller> caller) {
  if (const auto bad = check(request)) return refuse_watch(writer, *bad);
  const std::string interface = text_of(request.interface());
  auto parsed = parse_predicate(store_.index(rt::now()), interface, view_of(request.predicate()));
  if (!parsed) return refuse_watch(writer, Outcome::kBadPredicate, parsed.error().error);
  if (is_full(host)) return refuse_watch(writer, Outcome::kTooManyWatches);
  if (!thread_.is_running()) {
    auto thread = rt::Thread::start({.name = "rtpm-watches", .realtime = rt::RealtimeMode::kOff},
                                    [this] { run(); });
    if (!thread) return refuse_watch(writer, Outcome::kTooManyWatches);
    thread_ = std::move(*thread);
  }
  WatchFilter filter{.directory = text_of(request.directory()),
                     .interface = interface,
                     .predicate = std::move(*parsed),
                     .caller = std::move(caller)};
  if (request.names() != nullptr) {
    for (const auto* name : *request.names())
      filter.names.insert(name->str());
  }
  std::optional<std::uint64_t> after;
  // A registry with a shared storage may not have the changes yet that another one has reported.
  const bool is_to_come = request.after() > store_.log().revision();
  const bool is_known =
      request.history() == history_ && (store_.log().reaches(request.after()) || is_to_come);
  if (is_known) after = request.after();
  watchers_.push_back(std::make_unique<Watcher>(std::move(writer), std::move(filter), history_,
                                                after, store_, host));
  bell_.post();
}

void Watches::run() {
  for (;;) {
    const MonotonicTime next = turn();
    {
      const std::lock_guard lock(mutex_);
      if (is_stopping_) return;
    }
    if (next > rt::now()) static_cast<void>(bell_.wait_until(next));
  }
}

// Serves every watcher once. Returns when to continue.
MonotonicTime Watches::turn() {
  const std::lock_guard lock(mutex_);
  const MonotonicTime now = rt::now();
  store_.expire(now);
  MonotonicTime next = std::min(now + kLookInterval, store_.next_expiry());
  std::erase_if(watchers_, [&](const auto& watcher) {
    switch (watcher->pump(store_, storage_, now)) {
      case Watcher::Outcome::kMore:
        next = now;
        return false;
      case Watcher::Outcome::kBacklog:
        next = std::min(next, now + kBacklogInterval);
        return false;
      case Watcher::Outcome::kDone:
        return false;
      case Watcher::Outcome::kTooSlow:
        ++cut_off_count_;
        return true;
      case Watcher::Outcome::kGone:
        break;
    }
    return true;
  });
  return next;
}

}  // namespace rtpm::names
