#include "stop/stop_round.hpp"

#include <algorithm>
#include <array>
#include <device.rtpm.hpp>
#include <mutex>
#include <utility>

#include "events/stop_event.hpp"
#include "rtpm/gvd/error.hpp"
#include "rtpm/names/reachable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::gvd {
namespace {

constexpr std::string_view kHubInterface = "rtpm.events.Hub";
/// How many servers of a name service are called concurrently.
constexpr std::size_t kThreadCountMax = 64;
/// The share of the total time that name services have to answer.
constexpr double kSearchShare = 0.6;
constexpr std::size_t kNoteCountMax = 64;
constexpr std::size_t kTargetCountMax = 4 * kRememberedDeviceCountMax;

Duration left_until(MonotonicTime deadline) {
  return std::max(deadline - rt::now(), Duration{0});
}

bool is_absence(const std::error_code& cause) {
  return cause == rpc::CallError::kUnreachable || cause == rpc::CallError::kNoSuchObject ||
         cause == rpc::CallError::kWrongInterface;
}

/// A server that refuses this caller the highest priority may accept the call at its own.
bool may_be_priority(const std::error_code& cause) {
  return cause == rpc::CallError::kPriorityNotAllowed || cause == rpc::CallError::kWrongBand ||
         cause == rpc::CallError::kRefused;
}

}  // namespace

StopRound::StopRound(rpc::Node& node, StopRoundConfig config)
    : node_(node), config_(std::move(config)), id_(random_stop_id()) {}

void StopRound::add(const StopTarget& target) {
  add(target, target.url, /*is_listed=*/false, jobs_of({}));
}

void StopRound::run() {
  if (config_.tells_hubs && !config_.hub.empty()) {
    hubs_.insert(config_.hub);
    jobs_of({}).add([this] { tell(config_.hub); });
  }
  const auto share =
      std::chrono::duration_cast<Duration>((config_.deadline - config_.begin) * kSearchShare);
  const auto searched =
      names::ask_every_service(node_, config_.where, config_.begin + share,
                               [this](names::ServiceAnswer answer) { take(std::move(answer)); });
  if (!searched) {
    note(searched.error().reason());
    if (!report_.search_error) report_.search_error = searched.error();
  }
  if (has_answer_) report_.search_error.reset();
  for (auto& [service, jobs] : jobs_)
    jobs->finish();
}

void StopRound::take(names::ServiceAnswer answer) {
  if (answer.error) {
    note(answer.error->reason());
    const std::lock_guard lock(mutex_);
    if (!report_.search_error) report_.search_error = *answer.error;
  } else {
    const std::lock_guard lock(mutex_);
    has_answer_ = true;
  }
  rt::ParallelJobs& jobs = jobs_of(answer.url);
  // A server that hangs may continue when the call arrives, or later.
  for (const names::LapsedName& lapsed : answer.lapsed) {
    names::NameEntry entry{.name = lapsed.name, .url = lapsed.url, .interface = lapsed.interface};
    entry.is_of_other_host = lapsed.is_of_other_host;
    if (const auto target = config_.choose(entry)) add(*target, entry, jobs);
  }
  for (const names::NameEntry& entry : answer.names) {
    if (const auto target = config_.choose(entry)) {
      add(*target, entry, jobs);
    } else if (config_.tells_hubs && entry.interface == kHubInterface) {
      const auto url = names::reachable_url(entry);
      const std::lock_guard lock(mutex_);
      if (url && hubs_.insert(*url).second) jobs.add([this, hub = *url] { tell(hub); });
    }
  }
}

void StopRound::add(const StopTarget& target, const names::NameEntry& entry,
                    rt::ParallelJobs& jobs) {
  const auto url = names::reachable_url(entry);
  if (!url) return note(url.error().reason());
  add(target, *url + target.url.substr(entry.url.size()), /*is_listed=*/true, jobs);
}

void StopRound::add(const StopTarget& target, const std::string& url, bool is_listed,
                    rt::ParallelJobs& jobs) {
  const auto parts = wire::parse_url(url);
  const std::string authority = parts ? parts->authority() : url;
  const std::lock_guard lock(mutex_);
  if (tried_.size() >= kTargetCountMax && !tried_.contains(target)) return;
  tried_[target].is_listed |= is_listed;
  if (!begun_.emplace(target, url).second) return;
  Server& server = servers_[authority];
  server.left.emplace_back(target, url);
  if (std::exchange(server.is_served, true)) return;
  jobs.add([this, authority] { serve(authority); });
}

void StopRound::serve(const std::string& authority) {
  std::optional<Tried> in_vain;
  std::unique_lock lock(mutex_);
  Server& server = servers_[authority];
  while (!server.left.empty()) {
    const auto [target, url] = std::move(server.left.front());
    server.left.pop_front();
    lock.unlock();
    Tried tried = in_vain ? *in_vain : attempt(url, config_.scope_of(target.device));
    if (!tried.is_stopped && left_until(config_.deadline) == Duration{0}) in_vain = tried;
    lock.lock();
    Tried& known = tried_[target];
    // The server may have been reached at another of its addresses.
    if (known.is_stopped) continue;
    tried.is_listed = known.is_listed;
    known = std::move(tried);
  }
  server.is_served = false;
}

StopRound::Tried StopRound::attempt(const std::string& url, StopScope scope) {
  const std::array<std::optional<Priority>, 2> priorities{Priority{Priority::kHighest},
                                                          std::nullopt};
  Tried tried;
  for (const std::optional<Priority>& priority : priorities) {
    rpc::BindOptions bind;
    bind.deadline = left_until(config_.deadline);
    if (priority) bind.warm_up = {*priority};
    auto stub = device::DeviceClient::bind(node_, url, bind);
    if (!stub) {
      tried.why = stub.error().reason();
      tried.is_absent = is_absence(stub.error().cause);
      if (may_be_priority(stub.error().cause)) continue;
      return tried;
    }
    rpc::CallOptions options{.priority = priority, .deadline = left_until(config_.deadline)};
    const auto reply =
        stub->emergency_stop(device::Stop{static_cast<device::StopScope>(scope)}, options);
    if (reply) {
      const auto outcome = static_cast<DeviceOutcome>(reply->code());
      tried.is_stopped = outcome == DeviceOutcome::kDone || outcome == DeviceOutcome::kNotInSystem;
      tried.why = outcome == DeviceOutcome::kDone ? "" : std::string(to_string(outcome));
      return tried;
    }
    tried.why = std::string(to_string(reply.error()));
    if (!may_be_priority(make_error_code(reply.error()))) return tried;
  }
  return tried;
}

void StopRound::tell(const std::string& hub) {
  // The steps: bind the hub, call it, destroy the supplier.
  constexpr int kStepCount = 3;
  auto supplier = events::Supplier::create(node_, hub,
                                           {.name = "emergency stop",
                                            .priority = Priority{Priority::kHighest},
                                            .types = {&device::StopAllRequestedEvent::kDescriptor},
                                            .deadline = left_until(config_.deadline) / kStepCount});
  if (!supplier) return note("the hub at " + hub + " is not told: " + supplier.error().reason());
  if (const auto pushed = push_stop(**supplier, id_); !pushed) {
    return note("the hub at " + hub + " is not told: " + std::string(to_string(pushed.error())));
  }
  const std::lock_guard lock(mutex_);
  ++report_.told_hub_count;
}

void StopRound::note(std::string sentence) {
  const std::lock_guard lock(mutex_);
  if (report_.notes.size() < kNoteCountMax) report_.notes.push_back(std::move(sentence));
}

rt::ParallelJobs& StopRound::jobs_of(const std::string& service) {
  const std::lock_guard lock(mutex_);
  auto& jobs = jobs_[service];
  if (!jobs) jobs = std::make_unique<rt::ParallelJobs>("rtpm-stop", kThreadCountMax);
  return *jobs;
}

}  // namespace rtpm::gvd
