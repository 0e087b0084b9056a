#include "subscription.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "rtpm/base/printable.hpp"
#include "rtpm/capture/hub_recorder.hpp"
#include "rtpm/events/filter_text.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::python {
namespace {

/// The most bytes of payloads that wait for Python.
constexpr std::size_t kByteMax = std::size_t{64} << 20;
constexpr std::size_t kNoticeCountMax = 16;
constexpr Duration kLossReportInterval = std::chrono::seconds{1};

events::ConsumerConfig config_of(const SubscriptionSettings& settings) {
  events::ConsumerConfig config{.name = "python"};
  config.realtime = rt::RealtimeMode::kOff;
  config.priority = settings.priority;
  config.multicast = settings.multicast;
  config.delivery = settings.delivery;
  config.delivery.when_full =
      settings.keeps_latest ? events::QueuePolicy::kKeepLatest : events::QueuePolicy::kDropOldest;
  // As many as arrive while the consumer's thread pauses; on_events() keeps to the program's limit.
  constexpr std::uint32_t kCapacityMin = 64;
  config.delivery.queue_capacity =
      settings.keeps_latest
          ? std::min(settings.queue_capacity, events::kLatestQueueCapacityMax)
          : std::clamp(settings.queue_capacity, kCapacityMin, events::kQueueCapacityMax);
  for (const auto& type : settings.types)
    config.types.push_back(&type->descriptor);
  return config;
}

std::string text_of(const std::string& hub, std::uint64_t count, const MissedEvents& all) {
  struct Cause {
    std::uint64_t count;
    std::string_view text;
  };
  const events::Losses& way = all.on_the_way;
  const std::array causes{
      Cause{all.queue_count, "this program's queue was full"},
      Cause{all.memory_count, "this program's queue held 64 MiB"},
      Cause{all.replaced_count + way.replaced_count, "newer ones replaced them"},
      Cause{way.overflow_count, "more waited on the way than its queue takes"},
      Cause{way.overrun_count, "its thread read the hub's ring too slowly"},
      Cause{way.unrepaired_count, "the network lost them"},
      Cause{way.memory_count, "the hub's memory was full"},
      Cause{way.too_large_count, "they were too large for the transport"},
      Cause{way.suspended_count, "the subscription was suspended"},
  };
  std::string text = hub + ": " + std::to_string(count) + " events were lost; in all ";
  std::string_view separator;
  for (const Cause& cause : causes) {
    if (cause.count == 0) continue;
    text.append(separator).append(std::to_string(cause.count)).append(" because ");
    text.append(cause.text);
    separator = ", ";
  }
  return text;
}

}  // namespace

expected<std::shared_ptr<Subscription>, SetupError> Subscription::open(
    SharedNode node, SubscriptionSettings settings, std::string& filter_error) {
  const auto known = events::HubTypes::ask(node->node, settings.hub);
  if (!known) return unexpected{known.error()};
  std::vector<const events::EventDescriptor*> types = known->list();
  for (const auto& type : settings.types) {
    if (known->find(type->descriptor.type) == nullptr) types.push_back(&type->descriptor);
  }
  auto filter = events::parse_filter(settings.filter, types);
  if (!filter) {
    filter_error = filter.error().what + '\n' + filter.error().picture(settings.filter);
    return nullptr;
  }
  auto self = std::make_shared<Subscription>(std::move(node), std::move(settings));
  events::ConsumerConfig config = config_of(self->settings_);
  config.filter = *std::move(filter);
  auto consumer =
      events::Consumer::create(self->node_->node, self->settings_.hub, std::move(config), *self);
  if (!consumer) return unexpected{std::move(consumer.error())};
  const std::lock_guard lock(self->consumer_mutex_);
  self->consumer_ = std::move(*consumer);
  return self;
}

Subscription::Subscription(SharedNode node, SubscriptionSettings settings)
    : node_(std::move(node)), settings_(std::move(settings)), process_(::getpid()) {}

Subscription::~Subscription() {
  close();
  if (event_descriptor_ >= 0) ::close(event_descriptor_);
}

bool Subscription::wait(Duration span) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, span, [this] { return has_news(); });
}

std::vector<WaitingEvent> Subscription::take() {
  const std::lock_guard lock(mutex_);
  std::vector<WaitingEvent> delivery;
  while (!waiting_.empty()) {
    delivery.push_back(remove_front());
    if (!delivery.back().header.is_continued) break;
  }
  return delivery;
}

std::vector<WaitingEvent> Subscription::take_alike(std::size_t count_max,
                                                   const events::EventHeader& header,
                                                   std::size_t payload_size) {
  const std::lock_guard lock(mutex_);
  std::vector<WaitingEvent> events;
  events.reserve(std::min(count_max, waiting_.size()));
  while (!waiting_.empty() && events.size() < count_max) {
    const WaitingEvent& next = waiting_.front();
    if (next.header.type != header.type || next.header.schema_id != header.schema_id ||
        next.header.is_continued || next.payload.size() != payload_size) {
      break;
    }
    events.push_back(remove_front());
  }
  return events;
}

std::optional<std::pair<events::EventHeader, std::size_t>> Subscription::peek() const {
  const std::lock_guard lock(mutex_);
  if (waiting_.empty()) return std::nullopt;
  return std::pair{waiting_.front().header, waiting_.front().payload.size()};
}

std::vector<std::string> Subscription::take_notices(bool is_last) {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> notices(notices_.begin(), notices_.end());
  notices_.clear();
  const std::uint64_t unreported = missed_.total() - reported_loss_count_;
  const MonotonicTime now = rt::now();
  const bool is_due = is_last || now - last_loss_report_ >= kLossReportInterval;
  if (unreported > 0 && is_due) {
    notices.push_back(printable(text_of(settings_.hub, unreported, missed_)));
    reported_loss_count_ += unreported;
    last_loss_report_ = now;
  }
  needs_attention_ = is_closed_ || !end_reason_.empty() || (unreported > 0 && !is_due);
  if (!has_news()) clear_signal();
  return notices;
}

std::string Subscription::end_reason() const {
  const std::lock_guard lock(mutex_);
  return end_reason_;
}

bool Subscription::is_closed() const {
  const std::lock_guard lock(mutex_);
  return is_closed_;
}

std::int64_t Subscription::host_time_ns(const WaitingEvent& event) const {
  const std::lock_guard lock(consumer_mutex_);
  // The ring is on the hub's host, so both clocks are one. On other hosts only differences of the
  // hub's times are valid; the origin is then late by the transit from the hub.
  const bool is_same_clock = consumer_ != nullptr && consumer_->reads_ring();
  const MonotonicTime origin = is_same_clock
                                   ? event.header.origin
                                   : event.received - (event.header.hub_sent - event.header.origin);
  return to_ns(origin);
}

std::uint32_t Subscription::uncertainty_ns(const WaitingEvent& event) const {
  const std::lock_guard lock(consumer_mutex_);
  const bool is_same_clock = consumer_ != nullptr && consumer_->reads_ring();
  return is_same_clock ? event.header.origin_uncertainty_ns : events::kUncertaintyUnknown;
}

MissedEvents Subscription::missed() const {
  std::optional<events::Losses> on_the_way;
  {
    const std::lock_guard lock(consumer_mutex_);
    if (consumer_ != nullptr) on_the_way = consumer_->counters().losses;
  }
  const std::lock_guard lock(mutex_);
  MissedEvents missed = missed_;
  if (on_the_way) missed.on_the_way = *on_the_way;
  return missed;
}

int Subscription::file_descriptor() {
  const std::lock_guard lock(mutex_);
  if (event_descriptor_ < 0) {
    event_descriptor_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (has_news()) signal();
  }
  return event_descriptor_;
}

void Subscription::close() {
  if (::getpid() != process_) {
    // In a forked child the consumer's threads do not exist, so nothing could end it.
    static_cast<void>(consumer_.release());
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    is_closed_ = true;
    needs_attention_ = true;
    signal();
  }
  std::unique_ptr<events::Consumer> consumer;
  {
    const std::lock_guard lock(consumer_mutex_);
    consumer = std::move(consumer_);
  }
  if (consumer == nullptr) return;
  consumer->unsubscribe();
  const std::lock_guard lock(mutex_);
  missed_.on_the_way = consumer->counters().losses;
}

void Subscription::on_events(std::span<const events::EventView> events) {
  const MonotonicTime now = rt::now();
  std::size_t size = 0;
  for (const events::EventView& event : events)
    size += event.payload.size();
  const std::lock_guard lock(mutex_);
  const std::uint64_t missed_before = missed_.total();
  if (settings_.keeps_latest && events.size() == 1) drop_like(events.front().header);
  while (!waiting_.empty() && waiting_.size() + events.size() > settings_.queue_capacity)
    drop_oldest(missed_.queue_count);
  while (!waiting_.empty() && byte_count_ + size > kByteMax)
    drop_oldest(missed_.memory_count);
  const bool is_too_many = events.size() > settings_.queue_capacity;
  if (is_too_many) missed_.queue_count += events.size();
  if (!is_too_many && size > kByteMax) missed_.memory_count += events.size();
  if (missed_.total() != missed_before) needs_attention_ = true;
  if (is_too_many || size > kByteMax) return;
  const bool had_news = has_news();
  for (const events::EventView& event : events) {
    WaitingEvent& added = waiting_.emplace_back(WaitingEvent{
        event.header, now, std::vector<std::byte>(event.payload.begin(), event.payload.end())});
    added.header.is_continued = &event != &events.back();
  }
  byte_count_ += size;
  if (!had_news) signal();
}

void Subscription::on_notice(const events::Notice& notice) {
  const bool is_loss = notice.kind == events::NoticeKind::kLosses;
  std::string text = is_loss ? "" : printable(capture::text_of(notice, settings_.hub));
  const std::lock_guard lock(mutex_);
  needs_attention_ = true;
  missed_.on_the_way = notice.losses;
  if (notice.kind == events::NoticeKind::kEnded) {
    end_reason_ = text;
  } else if (!text.empty() && notices_.size() < kNoticeCountMax) {
    notices_.push_back(std::move(text));
  }
  if (has_news()) signal();
}

void Subscription::drop_oldest(std::uint64_t& count) {
  while (!waiting_.empty()) {
    ++count;
    if (!remove_front().header.is_continued) break;
  }
}

void Subscription::drop_like(const events::EventHeader& header) {
  // Only single events: a conjunction is one whole.
  bool is_inside = false;
  const auto found = std::ranges::find_if(waiting_, [&](const WaitingEvent& event) {
    const bool is_single = !is_inside && !event.header.is_continued;
    is_inside = event.header.is_continued;
    return is_single && event.header.type == header.type && event.header.source == header.source;
  });
  if (found == waiting_.end()) return;
  byte_count_ -= found->payload.size();
  waiting_.erase(found);
  ++missed_.replaced_count;
}

WaitingEvent Subscription::remove_front() {
  WaitingEvent event = std::move(waiting_.front());
  waiting_.pop_front();
  byte_count_ -= event.payload.size();
  if (!has_news()) clear_signal();
  return event;
}

bool Subscription::has_news() const noexcept {
  return !waiting_.empty() || !notices_.empty() || !end_reason_.empty() || is_closed_;
}

void Subscription::signal() noexcept {
  changed_.notify_all();
  if (event_descriptor_ >= 0) static_cast<void>(::eventfd_write(event_descriptor_, 1));
}

void Subscription::clear_signal() noexcept {
  eventfd_t count = 0;
  if (event_descriptor_ >= 0) static_cast<void>(::eventfd_read(event_descriptor_, &count));
}

}  // namespace rtpm::python
