#include "follow.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "base64.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::etcd_store {
namespace {

using namespace std::chrono_literals;

constexpr Duration kProbeInterval = 500ms;
constexpr Duration kProbePatience = 1s;
constexpr Duration kFuturePause = 1ms;
// How long a new watch may take to start.
constexpr Duration kBeginPatience = 1s;
constexpr Duration kReadPatience = 5s;
constexpr Duration kPauseMax = 500ms;
constexpr int kEndedLeasesPerProbe = 64;
// After this many consecutive probes that find unreported changes, everything is read again.
constexpr int kUnmetMax = 4;
constexpr const char* kCompacted = "the changes since are not kept any more";
constexpr const char* kReplaced =
    "it was restored or replaced, and changes that it had told are not there any more";

// Whether etcd does not have the revision yet. A revision that it has dropped has the same code.
bool is_future(const GatewayError& error) {
  return error.code == GatewayError::kOutOfRange &&
         error.why.find("future revision") != std::string::npos;
}

}  // namespace

expected<void, SetupError> Follow::start(names::Storage::Follower& follower,
                                         std::uint64_t revision) {
  follower_ = &follower;
  revision_ = revision;
  note_reported();
  auto thread = rt::Thread::start({.name = "rtpm-etcd", .realtime = rt::RealtimeMode::kOff},
                                  [this] { run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  thread_ = std::move(*thread);
  return {};
}

void Follow::stop() noexcept {
  gateway_.stop();
  { const std::lock_guard lock(mutex_); }  // So that no wait_for() misses the notification.
  reporting_.notify_all();
  stream_.wake();
  if (thread_.is_running()) thread_.join();
}

bool Follow::wait_for(std::uint64_t revision, MonotonicTime deadline) {
  std::unique_lock lock(mutex_);
  static_cast<void>(reporting_.wait_for(lock, std::max(deadline - rt::now(), Duration{0}), [&] {
    return reported_ >= revision || gateway_.is_stopping();
  }));
  return reported_ >= revision;
}

bool Follow::has_reported(std::uint64_t revision) {
  const std::lock_guard lock(mutex_);
  return reported_ >= revision;
}

// Lower than before if a cluster was restored.
void Follow::note_reported() {
  {
    const std::lock_guard lock(mutex_);
    reported_ = revision_;
  }
  reporting_.notify_all();
}

void Follow::run() {
  while (!gateway_.is_stopping()) {
    const std::size_t endpoint = gateway_.preferred();
    const std::string why = follow_at(endpoint);
    if (gateway_.is_stopping()) break;
    if (gateway_.adopt_other_cluster())
      static_cast<void>(read_again(History::kReplaced, kReplaced));
    // The next watch starts after the content that was read.
    const bool was_read = std::exchange(was_read_again_, false);
    is_to_check_history_ = !was_read;
    ++failure_count_;
    if (!was_read) {
      gateway_.avoid(endpoint);
      note_trouble(endpoint, why);
    }
    // Tries each endpoint once without a pause.
    const std::size_t round = failure_count_ / gateway_.address().endpoints.size();
    if (round > 0) pause(std::min<Duration>(round * 50ms, kPauseMax));
  }
  stream_.close();
}

void Follow::pause(Duration duration) {
  const MonotonicTime end = rt::now() + duration;
  while (!gateway_.is_stopping() && rt::now() < end)
    rt::sleep_until(std::min(end, rt::now() + 20ms));
}

// Runs until the watch breaks. Returns why.
std::string Follow::follow_at(std::size_t endpoint) {
  fragments_.clear();
  probe_.reset();
  is_created_ = false;
  Json request = keys_.all();
  request["start_revision"] = std::to_string(revision_ + 1);
  request["fragment"] = true;
  stream_.open(gateway_.url(endpoint, "/v3/watch"), Json{{"create_request", request}}.dump());
  const MonotonicTime begin_by = rt::now() + kBeginPatience;
  MonotonicTime next_probe = rt::now();
  while (!gateway_.is_stopping()) {
    auto line = stream_.next_line(is_created_ ? next_probe : begin_by);
    if (!line) return line.error().why;
    if (*line) {
      if (auto why = take(endpoint, **line)) return *why;
      check_probe();
    } else if (!is_created_ && rt::now() >= begin_by) {
      return "it does not begin a watch";
    }
    if (is_created_ && rt::now() >= next_probe) {
      if (is_to_check_history_) {
        if (auto why = check_history()) return *why;
      }
      if (auto why = probe(endpoint)) return *why;
      check_probe();
      end_unused_leases(endpoint);
      next_probe = rt::now() + kProbeInterval;
    }
  }
  return {};
}

// Handles a line of the watch; returns why it cannot continue.
std::optional<std::string> Follow::take(std::size_t endpoint, const std::string& line) {
  if (line.empty()) return std::nullopt;
  const auto result = gateway_.parse(line, 200);
  if (!result) {
    gateway_.note_cluster(endpoint, result.error().other_cluster);
    return result.error().why;
  }
  if (number_at(*result, "compact_revision") != 0) {
    return read_again(History::kSame, kCompacted);
  }
  if (result->value("canceled", Json()) == true) return "it ended the watch";
  if (result->value("created", Json()) == true) is_created_ = true;
  if (auto why = take_events(endpoint, object_at(*result, "events"))) return why;
  // A change may arrive in several fragments.
  if (result->value("fragment", Json()) == true || fragments_.empty()) return std::nullopt;
  revision_ = fragments_.back().revision;
  follower_->on_changes(std::exchange(fragments_, {}));
  note_reported();
  return std::nullopt;
}

// Whether the name was removed at `revision` because its lease ended: an unbind also changes the
// name's fence.
expected<bool, GatewayError> Follow::has_lapsed(std::size_t endpoint, const std::string& name,
                                                std::uint64_t revision) {
  const Json request{{"key", to_base64(keys_.fence_of(name))},
                     {"revision", std::to_string(revision)},
                     {"serializable", true}};
  const MonotonicTime end = rt::now() + kProbePatience;
  auto answer = gateway_.ask_at(endpoint, "/v3/kv/range", request, kProbePatience);
  // etcd notifies its watchers just before it lets a reader see the revision.
  while (!answer && is_future(answer.error()) && rt::now() < end) {
    rt::sleep_until(rt::now() + kFuturePause);
    answer = gateway_.ask_at(endpoint, "/v3/kv/range", request, kProbePatience);
  }
  // The revision is compacted, so an unbind can't be proved.
  if (!answer && answer.error().code == GatewayError::kOutOfRange && !is_future(answer.error())) {
    return true;
  }
  if (!answer) return unexpected{answer.error()};
  const Json& fences = object_at(*answer, "kvs");
  return std::ranges::none_of(
      fences, [&](const Json& each) { return number_at(each, "mod_revision") == revision; });
}

std::optional<std::string> Follow::take_events(std::size_t endpoint, const Json& events) {
  const std::string malformed = "its watch tells what is no change of a name";
  for (const Json& event : events) {
    const auto key_value = key_value_of(object_at(event, "kv"));
    const auto name = key_value ? keys_.name_of(key_value->key) : std::nullopt;
    if (!name) return malformed;
    const std::uint64_t former = fragments_.empty() ? revision_ + 1 : fragments_.back().revision;
    if (key_value->mod_revision < former) return malformed;
    names::ReportedChange change{*name, key_value->mod_revision, std::nullopt};
    if (event.value("type", Json()) == "DELETE") {
      const auto known = known_.find(*name);
      if (!known || known->lease > Duration{0}) {
        const auto lapsed = has_lapsed(endpoint, *name, change.revision);
        if (!lapsed) return lapsed.error().why;
        change.has_lapsed = *lapsed;
      }
      known_.erase(*name);
    } else {
      ReadName read = read_name(*name, *key_value);
      known_.put(*name, read.known);
      if (!read.stored) follower_->on_trouble("A value in etcd is no name: " + *name + ".");
      change.stored = std::move(read.stored);
    }
    fragments_.push_back(std::move(change));
  }
  return std::nullopt;
}

// Reads, through the leader, the state that the watch must report soon.
std::optional<std::string> Follow::probe(std::size_t endpoint) {
  Json request = keys_.all();
  request["limit"] = 1;
  request["sort_order"] = "DESCEND";
  request["sort_target"] = "MOD";
  request["keys_only"] = true;
  Probe next{.begun = rt::now(), .revision = revision_};
  const auto answer = gateway_.ask_at(endpoint, "/v3/kv/range", request, kProbePatience);
  if (!answer) return answer.error().why;
  next.count = number_at(*answer, "count");
  for (const Json& each : object_at(*answer, "kvs"))
    next.last_change = number_at(each, "mod_revision");
  // The revision counts all changes of the cluster and never decreases.
  if (number_at(object_at(*answer, "header"), "revision") < revision_) {
    return read_again(History::kReplaced, kReplaced);
  }
  const bool is_behind = probe_ && !probe_->is_met && probe_->last_change == next.last_change &&
                         probe_->count == next.count && probe_->revision == revision_;
  if (is_behind) next.unmet_count = probe_->unmet_count + 1;
  probe_ = next;
  if (next.unmet_count < kUnmetMax) return std::nullopt;
  return read_again(History::kSame, "its watch left changes out");
}

void Follow::check_probe() {
  if (!probe_ || probe_->is_met) return;
  if (revision_ < probe_->last_change) return;
  // Changes after the probe may explain the different number of names.
  if (known_.size() != probe_->count && revision_ == probe_->revision) return;
  probe_->is_met = true;
  note_reached();
  current_as_of_ = probe_->begun;
}

// Checks that the changes reported up to the last revision match the cluster's content at that
// revision. A revision that the cluster no longer has proves nothing.
std::optional<std::string> Follow::check_history() {
  const auto then = read_content(gateway_, keys_, rt::now() + kReadPatience, revision_);
  const bool is_unknown = !then && then.error().code == GatewayError::kOutOfRange;
  if (!then && !is_unknown) return then.error().why;
  if (is_unknown) return read_again(History::kReplaced, kCompacted);
  if (!known_.are(then->known)) return read_again(History::kReplaced, kReplaced);
  is_to_check_history_ = false;
  return std::nullopt;
}

// Returns why the watch cannot continue; the next watch starts after the content read here.
std::string Follow::read_again(History history, std::string why) {
  const MonotonicTime begun = rt::now();
  auto content = read_content(gateway_, keys_, rt::now() + kReadPatience);
  if (!content) return content.error().why;
  if (content->revision < revision_) {
    history = History::kReplaced;
    why = kReplaced;
  }
  was_read_again_ = true;
  known_.replace(std::move(content->known));
  revision_ = content->revision;
  follower_->on_restart(std::move(content->names), revision_, history == History::kReplaced);
  note_reported();
  current_as_of_ = begun;
  follower_->on_trouble("All names in " + gateway_.address().text() + " were read again: " + why +
                        ".");
  return why;
}

// Revokes leases without names. They also expire, but the longest only after an hour.
void Follow::end_unused_leases(std::size_t endpoint) {
  for (int i = 0; i < kEndedLeasesPerProbe; ++i) {
    const auto lease = known_.take_unused();
    if (!lease) return;
    static_cast<void>(gateway_.ask_at(endpoint, "/v3/lease/revoke",
                                      {{"ID", std::to_string(*lease)}}, kProbePatience));
  }
}

void Follow::note_reached() {
  failure_count_ = 0;
  if (!std::exchange(is_told_, false)) return;
  follower_->on_trouble("The names in " + gateway_.address().text() + " are followed again.");
}

// Reports once after as many failures as endpoints: a single endpoint's failure does no harm.
void Follow::note_trouble(std::size_t endpoint, const std::string& why) {
  if (is_told_ || failure_count_ < gateway_.address().endpoints.size()) return;
  is_told_ = true;
  follower_->on_trouble("The names in " + gateway_.address().text() + " can't be followed: " +
                        gateway_.address().endpoints[endpoint] + ": " + why +
                        ". Reads go on from memory, and changes fail. Remedy: check that "
                        "most nodes of etcd run and reach each other.");
}

}  // namespace rtpm::etcd_store
