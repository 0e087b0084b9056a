#include "bridge.hpp"

#include <algorithm>
#include <chrono>
#include <device.rtpm.hpp>
#include <limits>
#include <utility>

#include "rtpm/gvd/client.hpp"
#include "rtpm/ros2/message.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::ros2 {
namespace {

using namespace std::chrono_literals;

constexpr Duration kRetry = 1s;
constexpr Duration kDiagnosticsInterval = 1s;
/// Changes within this time share a message.
constexpr Duration kChangeInterval = 50ms;

events::Filter of_types(std::initializer_list<events::EventType> types) {
  std::vector<events::Match> matches;
  for (const events::EventType type : types)
    matches.push_back({.type = type, .type_mask = std::numeric_limits<std::uint32_t>::max()});
  return events::listed(std::move(matches));
}

template <class M>
Topic topic(std::string name) {
  return {std::move(name), std::string(M::kType), type_hash<M>()};
}

}  // namespace

expected<std::unique_ptr<Bridge>, SetupError> Bridge::create(rpc::Node& node, const Domain& domain,
                                                             const BridgeConfig& config,
                                                             rt::Log& log) {
  std::unique_ptr<Bridge> bridge(new Bridge(node, config, log));
  if (auto begun = bridge->begin(domain); !begun) return unexpected{std::move(begun.error())};
  return bridge;
}

expected<void, SetupError> Bridge::begin(const Domain& domain) {
  auto participant = Participant::create(domain, config_.node);
  if (!participant) return unexpected{std::move(participant.error())};
  participant_ = std::move(*participant);
  auto diagnostics = participant_->publish(topic<DiagnosticArray>("/diagnostics"), {});
  if (!diagnostics) return unexpected{std::move(diagnostics.error())};
  diagnostics_ = std::move(*diagnostics);
  if (config_.has_tf) {
    auto tf = participant_->publish(topic<TfMessage>("/tf"), {.depth = 100});
    if (!tf) return unexpected{std::move(tf.error())};
    tf_ = std::move(*tf);
  }
  auto stops = StopRequests::create(
      node_, *participant_,
      {.where = config_.registry, .hub = config_.hub.starts_with("rtpm://") ? config_.hub : ""},
      log_);
  if (!stops) return unexpected{std::move(stops.error())};
  stops_ = std::move(*stops);
  auto thread = rt::Thread::start({.name = "rtpm-ros2-out"}, [this] { run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  thread_ = std::move(*thread);
  attend();
  return {};
}

Bridge::~Bridge() {
  watch_.reset();
  samples_.reset();
  changes_.reset();
  topic_events_.reset();
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_one();
  thread_.join();
  shown_.clear();
  by_source_.clear();
  stops_.reset();
  tf_.reset();
  diagnostics_.reset();
}

// ---- the program's thread -----------------------------------------------------------------------

void Bridge::attend() {
  follow_names();
  const MonotonicTime now = rt::now();
  if (now < next_retry_) return;
  next_retry_ = now + kRetry;
  subscribe_to_hub();
  report_absent_devices();
  watch_names();
}

void Bridge::subscribe_to_hub() {
  std::string problem;
  const auto keep = [&problem](auto& member, auto made) {
    if (made) {
      member = std::move(*made);
    } else {
      problem = made.error().text();
    }
  };
  if (!samples_) {
    events::DeliveryPolicy delivery;
    delivery.interval =
        std::chrono::duration_cast<Duration>(std::chrono::duration<double>(1 / config_.rate_hz));
    delivery.is_interval_per_source = true;
    delivery.when_full = events::QueuePolicy::kKeepLatest;
    keep(samples_, consume("ros2-samples", {gvd::kSampled}, std::move(delivery)));
  }
  if (!changes_ && problem.empty()) {
    events::DeliveryPolicy delivery;
    delivery.queue_capacity = 1024;
    keep(changes_, consume("ros2-changes",
                           {gvd::kButtonChanged, gvd::kLifecycleChanged, gvd::kFaultChanged,
                            gvd::kLeaseChanged, gvd::kStopChanged},
                           std::move(delivery)));
  }
  if (!topic_events_ && !config_.events.empty() && problem.empty()) {
    keep(topic_events_, TopicEvents::create(node_, *participant_, config_.hub, config_.events));
  }
  report_problem("hub", problem);
}

expected<gvd::DeviceConsumer, SetupError> Bridge::consume(
    const char* name, std::initializer_list<events::EventType> types,
    events::DeliveryPolicy delivery) {
  gvd::DeviceConsumerConfig config{.hub = config_.hub};
  config.subscription.name = name;
  config.subscription.filter = of_types(types);
  config.subscription.delivery = std::move(delivery);
  // Its handler shares locks with threads that write DDS.
  config.subscription.realtime = rt::RealtimeMode::kOff;
  return gvd::DeviceConsumer::start(node_, std::move(config), *this);
}

void Bridge::watch_names() {
  if (watch_) return;
  auto watch = names::NameWatch::start(
      node_, config_.registry,
      {.names = config_.devices, .interface = std::string(device::DeviceClient::interface().name)},
      {.on_change = [this](const names::NameChange& change) { note(change); },
       .on_state = {},
       .on_stale = {},
       .on_notice = [this](std::string_view sentence) { log_.write(sentence); }});
  report_problem("registry", watch ? std::string() : watch.error().text());
  if (watch) watch_ = std::move(*watch);
}

void Bridge::report_absent_devices() {
  if (!watch_) return;
  for (const auto* const list : {&config_.devices, &config_.commanded}) {
    for (const std::string& name : *list) {
      bool is_shown = false;
      {
        const std::lock_guard lock(mutex_);
        is_shown = shown_.contains(name);
      }
      report_problem("absent " + name, is_shown ? "" : name + " is not there; waiting for it");
    }
  }
}

void Bridge::note(const names::NameChange& change) {
  const std::lock_guard lock(names_mutex_);
  const bool is_gone = change.kind == names::NameChange::Kind::kGone;
  changed_names_[change.entry.name] = is_gone ? std::nullopt : std::optional(change.entry.url);
}

void Bridge::follow_names() {
  std::map<std::string, std::optional<std::string>> changed;
  {
    const std::lock_guard lock(names_mutex_);
    changed.swap(changed_names_);
  }
  for (const auto& [name, url] : changed) {
    hide(name);
    if (!url) continue;
    const auto shown = show(name, *url);
    report_problem(name, shown ? std::string() : shown.error().text());
    if (shown) continue;
    hide(name);
    // Try again, unless the name has changed meanwhile.
    const std::lock_guard lock(names_mutex_);
    changed_names_.try_emplace(name, url);
  }
}

expected<void, SetupError> Bridge::show(const std::string& name, const std::string& url) {
  if (auto given = given_.give(name); !given) return unexpected{std::move(given.error())};
  const auto client = gvd::DeviceClient::open(node_, name);
  if (!client) return unexpected{client.error()};
  auto topics = DeviceTopics::create(*participant_, name, client->descriptor(), tf_.get());
  if (!topics) return unexpected{std::move(topics.error())};
  Shown shown{.topics = std::move(*topics)};
  stops_->remember(name, url);
  auto stops = stops_->subscribe(*participant_, name);
  if (!stops) return unexpected{std::move(stops.error())};
  shown.stops = std::move(*stops);
  if (std::ranges::count(config_.commanded, name) > 0) {
    auto commands = DeviceCommands::create(node_, *participant_, name, config_.command);
    if (!commands) return unexpected{std::move(commands.error())};
    shown.commands = std::move(*commands);
  }
  log_.write("showing " + name);
  const std::lock_guard lock(mutex_);
  by_source_[gvd::source_of(name)] = shown.topics;
  shown_[name] = std::move(shown);
  return {};
}

void Bridge::hide(const std::string& name) {
  Shown ended;
  {
    const std::lock_guard lock(mutex_);
    by_source_.erase(gvd::source_of(name));
    const auto found = shown_.find(name);
    if (found == shown_.end()) return;
    ended = std::move(found->second);
    shown_.erase(found);
  }
  log_.write("no longer showing " + name);
}

void Bridge::report_problem(const std::string& key, const std::string& text) {
  std::string& last = problems_[key];
  if (!text.empty() && text != last) log_.write(text);
  last = text;
}

// ---- the consumers' threads ---------------------------------------------------------------------

void Bridge::on_events(std::span<const gvd::DeviceEvent> events) {
  for (const gvd::DeviceEvent& event : events) {
    std::shared_ptr<DeviceTopics> target;
    {
      const std::lock_guard lock(mutex_);
      const auto found = by_source_.find(event.header.source);
      if (found == by_source_.end()) {
        ++unknown_count_;
        continue;
      }
      target = found->second;
      has_news_ = true;
    }
    target->take(event);
  }
  changed_.notify_one();
}

// ---- the publishing thread ----------------------------------------------------------------------

void Bridge::run() {
  MonotonicTime next{};
  MonotonicTime last{};
  for (;;) {
    Targets targets;
    {
      std::unique_lock lock(mutex_);
      changed_.wait_for(lock, kChangeInterval, [this] { return has_news_ || is_stopping_; });
      if (is_stopping_) return;
      has_news_ = false;
      for (const auto& [name, shown] : shown_)
        targets.push_back(shown.topics);
    }
    for (const auto& target : targets)
      target->publish();
    const MonotonicTime now = rt::now();
    const bool is_changed =
        now - last >= kChangeInterval &&
        std::ranges::any_of(targets, [](const auto& target) { return target->is_changed(); });
    if (now < next && !is_changed) continue;
    publish_diagnostics(targets);
    last = now;
    next = now + kDiagnosticsInterval;
  }
}

void Bridge::publish_diagnostics(const Targets& targets) {
  const MonotonicTime now = rt::now();
  DiagnosticArray array{.header = {.stamp = time_of(static_cast<std::int64_t>(rt::utc_ns(now)))}};
  array.status.push_back(own_status());
  const std::set<std::string> owed = stops_->owed();
  for (const auto& target : targets) {
    DiagnosticStatus status = target->status(now);
    std::shared_ptr<DeviceCommands> commands;
    {
      const std::lock_guard lock(mutex_);
      const auto found = shown_.find(target->name());
      if (found != shown_.end()) commands = found->second.commands;
    }
    if (commands) commands->report(status.values);
    if (owed.contains(target->name())) {
      status.level = DiagnosticStatus::kError;
      status.message = "NOT STOPPED: the requested stop has not reached it yet";
    }
    array.status.push_back(std::move(status));
  }
  std::vector<std::byte> bytes;
  encode(array, bytes);
  static_cast<void>(diagnostics_->publish(bytes));
}

DiagnosticStatus Bridge::own_status() const {
  DiagnosticStatus status{.name = config_.node + ": bridge", .hardware_id = "rtpm"};
  status.message = "running";
  const std::lock_guard lock(mutex_);
  status.values.push_back({"devices", std::to_string(shown_.size())});
  status.values.push_back({"rate Hz", std::to_string(config_.rate_hz)});
  return status;
}

std::string Bridge::report() const {
  DeviceTopicsCounters sum;
  std::string commands;
  const std::lock_guard lock(mutex_);
  for (const auto& [name, shown] : shown_) {
    const DeviceTopicsCounters counters = shown.topics->counters();
    sum.published_count += counters.published_count;
    sum.failed_count += counters.failed_count;
    sum.replaced_count += counters.replaced_count;
    sum.lost_edge_count += counters.lost_edge_count;
    if (shown.commands) commands += "; commands of " + name + ": " + shown.commands->counts();
  }
  std::string text =
      "devices " + std::to_string(shown_.size()) + " published " +
      std::to_string(sum.published_count) + " not_sent " + std::to_string(sum.failed_count) +
      " replaced " + std::to_string(sum.replaced_count) + " lost_edges " +
      std::to_string(sum.lost_edge_count) + " of_other_devices " + std::to_string(unknown_count_);
  if (topic_events_) {
    text += " to_hub " + std::to_string(topic_events_->pushed_count()) + " lost_to_hub " +
            std::to_string(topic_events_->lost_count());
  }
  return text + commands;
}

}  // namespace rtpm::ros2
