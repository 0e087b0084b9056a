#include "live/hub_watch.hpp"

#include <algorithm>

#include "rtpm/gvd/device_event.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

constexpr Duration kFrameInterval = std::chrono::milliseconds{16};
constexpr Duration kHubDeadline = std::chrono::milliseconds{500};
constexpr Duration kTypesInterval = std::chrono::seconds{1};
/// Sources of events other than devices'; more are not shown.
constexpr std::size_t kSourceCountMax = 128;
constexpr std::uint32_t kChangeQueueCapacity = 1024;
constexpr std::uint32_t kLogRateMax = 200;
constexpr std::size_t kLogCountMax = 64;

bool is_device_type(events::EventType type) noexcept {
  // kSampled … StopAllRequested, see device_events.fbs.
  return type >= gvd::kSampled && type <= gvd::kConfigurationChanged + 1;
}

events::DeliveryPolicy decimated() {
  events::DeliveryPolicy policy;
  policy.interval = kFrameInterval;
  policy.when_full = events::QueuePolicy::kKeepLatest;
  policy.queue_capacity = events::kLatestQueueCapacityMax;
  policy.replay = 1;
  return policy;
}

}  // namespace

/// A subscription whose events go to the web server's thread.
class HubWatch::Tap final : public events::EventHandler {
 public:
  Tap(HubWatch& watch, EventStream stream, std::uint64_t connection_id) noexcept
      : watch_(watch), stream_(stream), connection_id_(connection_id) {}
  Tap(const Tap&) = delete;
  Tap& operator=(const Tap&) = delete;
  ~Tap() override { consumer_.reset(); }

  void on_events(std::span<const events::EventView> events) override {
    for (const events::EventView& event : events)
      take(event);
  }

  void on_notice(const events::Notice& notice) override {
    using events::NoticeKind;
    if (stream_ != EventStream::kChange) return;
    if (notice.kind == NoticeKind::kInterrupted) {
      watch_.set_standing(false, std::string(notice.text));
    } else if (notice.kind == NoticeKind::kEnded) {
      watch_.set_standing(false, std::string(notice.text));
      const std::lock_guard lock(watch_.mutex_);
      watch_.is_lost_ = true;
    } else if (notice.kind == NoticeKind::kResubscribed || notice.kind == NoticeKind::kSubscribed) {
      watch_.set_standing(true, {});
      const std::lock_guard lock(watch_.mutex_);
      watch_.was_restored_ = true;
    }
  }

  std::unique_ptr<events::Consumer> consumer_{};

 private:
  void take(const events::EventView& event) {
    if (stream_ == EventStream::kChange && !is_device_type(event.header.type)) {
      // The first events of a source: it gets a subscription of its own.
      const std::lock_guard lock(watch_.mutex_);
      if (event.header.type <= events::kEventTypeMax &&
          watch_.new_sources_.size() < kSourceCountMax) {
        watch_.new_sources_.insert({event.header.type, event.header.source});
      }
      return;
    }
    if (stream_ == EventStream::kLog && !is_admitted()) return;
    HubEvent copy{.stream = stream_,
                  .connection_id = connection_id_,
                  .omitted_count = std::exchange(omitted_count_, 0),
                  .header = event.header,
                  .arrived = rt::now(),
                  .payload = {event.payload.begin(), event.payload.end()}};
    watch_.post_([on_event = watch_.callbacks_.on_event, copy = std::move(copy)]() mutable {
      on_event(std::move(copy));
    });
  }

  /// At most kLogRateMax in each second.
  bool is_admitted() {
    const MonotonicTime now = rt::now();
    if (now - second_begin_ >= std::chrono::seconds{1}) {
      second_begin_ = now;
      admitted_count_ = 0;
    }
    if (admitted_count_ < kLogRateMax) return ++admitted_count_ > 0;
    ++omitted_count_;
    return false;
  }

  HubWatch& watch_;
  EventStream stream_;
  std::uint64_t connection_id_;
  MonotonicTime second_begin_{};
  std::uint32_t admitted_count_ = 0;
  std::uint64_t omitted_count_ = 0;
};

HubWatch::HubWatch(rpc::Node& node, std::string hub, Post post, HubCallbacks callbacks)
    : node_(node), hub_(std::move(hub)), post_(std::move(post)), callbacks_(std::move(callbacks)) {}
HubWatch::~HubWatch() = default;

void HubWatch::set_devices(std::vector<std::string> names) {
  const std::lock_guard lock(mutex_);
  devices_ = std::move(names);
}

void HubWatch::set_standing(bool is_ok, const std::string& problem) {
  post_([on_standing = callbacks_.on_standing, standing = Standing{is_ok, problem}] {
    on_standing(standing);
  });
}

std::unique_ptr<HubWatch::Tap> HubWatch::open(EventStream stream, std::uint64_t connection_id,
                                              events::ConsumerConfig config, std::string* problem) {
  auto tap = std::make_unique<Tap>(*this, stream, connection_id);
  config.name = "console";
  config.realtime = rt::RealtimeMode::kOff;
  config.deadline = kHubDeadline;
  auto consumer = events::Consumer::create(node_, hub_, std::move(config), *tap);
  if (!consumer) {
    if (problem != nullptr) *problem = consumer.error().reason();
    return nullptr;
  }
  tap->consumer_ = std::move(*consumer);
  return tap;
}

events::Filter HubWatch::main_filter() const {
  std::vector<events::Match> matches{{.type = gvd::kSampled, .type_mask = events::kWholeNumber}};
  for (const auto& [type, source] : sources_) {
    matches.push_back({.type = type,
                       .type_mask = events::kWholeNumber,
                       .source = source,
                       .source_mask = events::kWholeNumber});
  }
  return events::none_of(events::listed(std::move(matches)));
}

bool HubWatch::open_main() {
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(is_lost_, false)) main_.reset();
  }
  if (main_) return true;
  events::ConsumerConfig config{.filter = main_filter()};
  config.delivery.queue_capacity = kChangeQueueCapacity;
  config.delivery.replay = 1;
  std::string problem;
  main_ = open(EventStream::kChange, 0, std::move(config), &problem);
  set_standing(main_ != nullptr, problem);
  return main_ != nullptr;
}

void HubWatch::ask_types() {
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(was_restored_, false)) types_.reset();
    lacks_type_ = lacks_type_ || !types_;
    if (!lacks_type_ || rt::now() < next_types_) return;
    lacks_type_ = false;
  }
  next_types_ = rt::now() + kTypesInterval;
  auto types = events::HubTypes::ask(node_, hub_, kHubDeadline);
  if (!types) return;
  types_ = std::make_shared<const events::HubTypes>(std::move(*types));
  post_([on_types = callbacks_.on_types, types = types_] { on_types(types); });
}

void HubWatch::follow_devices() {
  std::vector<std::string> devices;
  {
    const std::lock_guard lock(mutex_);
    devices = devices_;
  }
  std::erase_if(samples_, [&](const auto& one) { return !std::ranges::count(devices, one.first); });
  for (const std::string& device : devices) {
    if (samples_.contains(device)) continue;
    events::ConsumerConfig config{.filter = gvd::samples_of(device), .delivery = decimated()};
    auto tap = open(EventStream::kSample, 0, std::move(config), nullptr);
    if (!tap) return;
    samples_[device] = std::move(tap);
    const std::lock_guard lock(mutex_);
    lacks_type_ = true;
  }
}

void HubWatch::follow_sources() {
  std::set<Key> found;
  {
    const std::lock_guard lock(mutex_);
    found = std::exchange(new_sources_, {});
  }
  bool has_changed = false;
  for (const Key& key : found) {
    if (sources_.size() >= kSourceCountMax || !sources_.insert(key).second) continue;
    has_changed = true;
    events::ConsumerConfig config{.filter = events::of_type(key.first, key.second),
                                  .delivery = decimated()};
    generic_[key] = open(EventStream::kGeneric, 0, std::move(config), nullptr);
    if (!generic_[key]) {
      generic_.erase(key);
      sources_.erase(key);
    }
  }
  if (!has_changed) return;
  {
    const std::lock_guard lock(mutex_);
    lacks_type_ = true;
  }
  events::DeliveryPolicy policy;
  policy.queue_capacity = kChangeQueueCapacity;
  static_cast<void>(main_->consumer_->change(main_filter(), policy));
}

void HubWatch::look() {
  std::set<std::uint64_t> ended;
  {
    const std::lock_guard lock(mutex_);
    ended = std::exchange(ended_logs_, {});
  }
  if (!ended.empty()) {
    const std::lock_guard lock(log_mutex_);
    for (const std::uint64_t id : ended)
      logs_.erase(id);
  }
  if (!open_main()) return;
  follow_devices();
  follow_sources();
  ask_types();
}

expected<void, events::FilterTextError> HubWatch::set_log(std::uint64_t connection_id,
                                                          const std::string& filter) {
  const auto types = events::HubTypes::ask(node_, hub_, kHubDeadline);
  if (!types) return unexpected{events::FilterTextError{0, types.error().reason()}};
  auto parsed = events::parse_filter(filter, types->list());
  if (!parsed) return unexpected{parsed.error()};
  events::ConsumerConfig config{.filter = std::move(*parsed)};
  config.delivery.queue_capacity = 256;
  std::string problem;
  auto tap = open(EventStream::kLog, connection_id, std::move(config), &problem);
  if (!tap) return unexpected{events::FilterTextError{0, problem}};
  const std::lock_guard lock(log_mutex_);
  if (logs_.size() >= kLogCountMax && !logs_.contains(connection_id)) {
    return unexpected{events::FilterTextError{0, "too many browsers show a log already"}};
  }
  logs_[connection_id] = std::move(tap);
  return {};
}

void HubWatch::stop() {
  logs_.clear();
  generic_.clear();
  samples_.clear();
  main_.reset();
}

void HubWatch::end_log(std::uint64_t connection_id) {
  const std::lock_guard lock(mutex_);
  ended_logs_.insert(connection_id);
}

}  // namespace rtpm::console
