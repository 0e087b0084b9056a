#include "live/hub_watch.hpp"

#include <algorithm>
#include <trial.rtpm.events.hpp>

#include "rtpm/gvd/device_event.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

constexpr Duration kFrameInterval = std::chrono::milliseconds{16};
constexpr Duration kHubDeadline = std::chrono::milliseconds{500};
constexpr Duration kTypesInterval = std::chrono::seconds{1};
constexpr std::uint32_t kQueueCapacity = 1024;
/// The most devices whose samples come from the hub; for the others, the console uses its own
/// reads.
constexpr std::size_t kFollowedCountMax = events::kIntervalSourceMax;
/// How many events the web server's thread handles before other work.
constexpr int kHandOverCount = 64;
constexpr std::uint32_t kLogRateMax = 200;
constexpr std::size_t kLogCountMax = 64;

/// The types of device_events.fbs from `first` on, without FlightCycle, which nobody pushes.
std::vector<events::Match> device_types(events::EventType first) {
  std::vector<events::Match> matches;
  for (events::EventType type = first; type <= gvd::kConfigurationChanged + 1; ++type)
    matches.push_back({.type = type, .type_mask = events::kWholeNumber});
  matches.push_back({.type = gvd::kModelsRendered, .type_mask = events::kWholeNumber});
  return matches;
}

/// A delivery of at most 60 events per second for each type and source.
events::DeliveryPolicy decimated() {
  events::DeliveryPolicy policy;
  policy.interval = kFrameInterval;
  policy.is_interval_per_source = true;
  policy.queue_capacity = kQueueCapacity;
  policy.replay = 1;
  return policy;
}

events::Filter samples_of(const std::vector<std::string>& devices) {
  std::vector<events::Match> matches;
  for (const std::string& device : devices) {
    matches.push_back({.type = gvd::kSampled,
                       .type_mask = events::kWholeNumber,
                       .source = gvd::source_of(device),
                       .source_mask = events::kWholeNumber});
  }
  return events::listed(std::move(matches));
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
    if (stream_ == EventStream::kGeneric && event.header.type > events::kEventTypeMax) return;
    if (stream_ == EventStream::kGeneric || stream_ == EventStream::kSample) {
      const std::lock_guard lock(watch_.mutex_);
      const bool is_known =
          watch_.types_ != nullptr && watch_.types_->find(event.header.type) != nullptr;
      watch_.lacks_type_ = watch_.lacks_type_ || !is_known;
    }
    const bool is_limited = stream_ == EventStream::kLog || stream_ == EventStream::kMark;
    if (is_limited && !is_admitted()) return;
    HubEvent copy{.stream = stream_,
                  .connection_id = connection_id_,
                  .omitted_count = std::exchange(omitted_count_, 0),
                  .header = event.header,
                  .arrived = rt::now(),
                  .payload = {event.payload.begin(), event.payload.end()}};
    watch_.deliver(std::move(copy));
  }

  /// Admits at most kLogRateMax events in each second.
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

void HubWatch::deliver(HubEvent event) {
  if (inbox_.push(std::move(event))) post_([this] { hand_over(); });
}

void HubWatch::hand_over() {
  for (int i = 0; i < kHandOverCount; ++i) {
    auto event = inbox_.pop();
    if (!event) return;
    callbacks_.on_event(std::move(*event));
  }
  if (!inbox_.is_empty()) post_([this] { hand_over(); });
}

bool HubWatch::open_main() {
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(is_lost_, false)) {
      main_.reset();
      samples_.reset();
      others_.reset();
      marks_.reset();
    }
  }
  if (main_) return true;
  events::ConsumerConfig config{.filter = events::listed(device_types(gvd::kSampled + 1))};
  config.delivery.queue_capacity = kQueueCapacity;
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
  auto asked = events::HubTypes::ask(node_, hub_, kHubDeadline);
  if (!asked) return;
  const auto types = std::make_shared<const events::HubTypes>(std::move(*asked));
  {
    const std::lock_guard lock(mutex_);
    types_ = types;
  }
  post_([on_types = callbacks_.on_types, types] { on_types(types); });
}

void HubWatch::follow_devices() {
  std::vector<std::string> devices;
  {
    const std::lock_guard lock(mutex_);
    devices = devices_;
  }
  if (devices.size() > kFollowedCountMax) devices.resize(kFollowedCountMax);
  if (devices.empty()) samples_.reset();
  if (devices.empty() || (samples_ && devices == followed_)) return;
  if (samples_ && !samples_->consumer_->change(samples_of(devices), decimated())) samples_.reset();
  if (!samples_) {
    events::ConsumerConfig config{.filter = samples_of(devices), .delivery = decimated()};
    samples_ = open(EventStream::kSample, 0, std::move(config), nullptr);
  }
  if (samples_) followed_ = std::move(devices);
}

void HubWatch::open_others() {
  if (others_) return;
  events::ConsumerConfig config{
      .filter = events::none_of(events::listed(device_types(gvd::kSampled))),
      .delivery = decimated()};
  others_ = open(EventStream::kGeneric, 0, std::move(config), nullptr);
}

void HubWatch::open_marks() {
  if (marks_) return;
  events::ConsumerConfig config{.filter = events::of_type(TrialEvent::kType)};
  config.delivery.queue_capacity = kQueueCapacity;
  marks_ = open(EventStream::kMark, 0, std::move(config), nullptr);
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
  open_others();
  open_marks();
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
  marks_.reset();
  others_.reset();
  samples_.reset();
  main_.reset();
}

void HubWatch::end_log(std::uint64_t connection_id) {
  const std::lock_guard lock(mutex_);
  ended_logs_.insert(connection_id);
}

}  // namespace rtpm::console
