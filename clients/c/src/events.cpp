#include <sys/eventfd.h>
#include <unistd.h>

#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "guard.hpp"
#include "node.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/filter_text.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/schema/dynamic.hpp"

using namespace rtpm;

namespace {

constexpr std::uint32_t kCapacityMax = 65536;
constexpr std::size_t kByteMax = std::size_t{64} << 20;

struct Waiting {
  events::EventHeader header{};
  std::vector<std::byte> payload{};
};

/// A type as the hub describes it, for payloads as JSON.
struct KnownType {
  std::string name{};
  std::unique_ptr<schema::Dynamic> schema{};
};

}  // namespace

/// A subscription, whose events wait for the program.
struct rtpm_events final : events::EventHandler {
  rtpm_events(rtpm_node& own, std::string at, std::uint32_t most)
      : node(own),
        hub(std::move(at)),
        capacity(most),
        descriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  ~rtpm_events() override {
    consumer.reset();
    if (descriptor >= 0) ::close(descriptor);
  }
  rtpm_events(const rtpm_events&) = delete;
  rtpm_events& operator=(const rtpm_events&) = delete;

  void on_events(std::span<const events::EventView> delivery) override {
    const std::lock_guard lock(mutex);
    for (const events::EventView& event : delivery) {
      while (!waiting.empty() &&
             (waiting.size() >= capacity || byte_count + event.payload.size() > kByteMax)) {
        drop_first();
        ++dropped_count;
      }
      waiting.push_back({event.header, {event.payload.begin(), event.payload.end()}});
      byte_count += event.payload.size();
    }
    signal();
  }
  void on_notice(const events::Notice& notice) override {
    const std::lock_guard lock(mutex);
    lost_on_the_way = notice.losses.total();
    if (notice.kind != events::NoticeKind::kEnded) return;
    is_ended = true;
    why_ended = notice.text;
    signal();
  }

  // The rest with the mutex.
  void signal() {
    const std::uint64_t one = 1;
    static_cast<void>(!::write(descriptor, &one, sizeof one));
    changed.notify_all();
  }
  void drop_first() {
    byte_count -= waiting.front().payload.size();
    waiting.pop_front();
  }
  /// The descriptor is readable while events wait.
  void settle() {
    std::uint64_t count = 0;
    if (waiting.empty() && !is_ended) static_cast<void>(!::read(descriptor, &count, sizeof count));
  }

  rtpm_node& node;
  std::string hub;
  std::uint32_t capacity;
  int descriptor;
  std::mutex mutex{};
  std::condition_variable changed{};
  std::deque<Waiting> waiting{};
  std::size_t byte_count = 0;
  std::uint64_t dropped_count = 0;
  std::uint64_t lost_on_the_way = 0;
  bool is_ended = false;
  std::string why_ended{};
  /// The last event that was given refers to these, which `taking` guards.
  std::mutex taking{};
  Waiting given{};
  std::string json{};
  std::map<events::EventType, KnownType> types{};
  std::unique_ptr<events::Consumer> consumer{};
};

namespace {

void learn(rtpm_events& self, const events::HubTypes& known) {
  for (const events::EventDescriptor* const type : known.list()) {
    std::string error;
    KnownType& made = self.types[type->type];
    made = {std::string(type->name),
            schema::Dynamic::make_for_event(std::string(type->schema), type->name, error)};
  }
}

/// The event's type; nullptr if the hub does not know it. A new one is asked for once.
const KnownType* type_of(rtpm_events& self, events::EventType type) {
  auto found = self.types.find(type);
  if (found == self.types.end()) {
    if (const auto known = events::HubTypes::ask(self.node.node, self.hub)) learn(self, *known);
    found = self.types.try_emplace(type).first;
  }
  return found->second.schema ? &found->second : nullptr;
}

rtpm_event in_c(rtpm_events& self, std::uint64_t lost_count) {
  const events::EventHeader& header = self.given.header;
  const KnownType* const type = type_of(self, header.type);
  self.json.clear();
  if (type != nullptr)
    self.json = type->schema->decode(type->schema->event(), self.given.payload).value_or("");
  rtpm_event out RTPM_EVENT_INIT;
  out.type = header.type;
  out.source = header.source;
  out.is_replayed = header.is_replayed ? 1 : 0;
  out.sequence = header.sequence;
  out.origin_ns = header.origin.time_since_epoch().count();
  out.type_name = type == nullptr ? "" : type->name.c_str();
  out.json = self.json.c_str();
  out.payload = self.given.payload.data();
  out.payload_size = self.given.payload.size();
  out.lost_count = lost_count;
  return out;
}

}  // namespace

rtpm_status rtpm_events_open(rtpm_node* node, const char* hub, const char* filter,
                             uint32_t capacity, rtpm_events** events) {
  return c::guarded([&] {
    if (node == nullptr || events == nullptr)
      return c::invalid("rtpm_events_open: node and events must not be NULL");
    if (capacity < 1 || capacity > kCapacityMax)
      return c::invalid("capacity is 1 to 65536, not " + std::to_string(capacity));
    const std::string where = hub == nullptr ? std::string(events::kHubPath) : hub;
    const auto known = events::HubTypes::ask(node->node, where);
    if (!known) return c::failed(known.error(), RTPM_UNREACHABLE);
    events::ConsumerConfig config{.name = "c"};
    config.realtime = rt::RealtimeMode::kOff;
    config.delivery.when_full = events::QueuePolicy::kDropOldest;
    config.delivery.queue_capacity =
        std::clamp<std::uint32_t>(capacity, 64, events::kQueueCapacityMax);
    if (filter != nullptr && *filter != '\0') {
      auto parsed = events::parse_filter(filter, known->list());
      if (!parsed) return c::invalid(parsed.error().what + '\n' + parsed.error().picture(filter));
      config.filter = *std::move(parsed);
    }
    auto self = std::make_unique<rtpm_events>(*node, where, capacity);
    if (self->descriptor < 0) return c::failed(RTPM_FAILED, "this process has no descriptor left");
    learn(*self, *known);
    auto consumer = events::Consumer::create(node->node, where, std::move(config), *self);
    if (!consumer) return c::failed(consumer.error(), RTPM_REFUSED);
    self->consumer = std::move(*consumer);
    *events = self.release();
    return rtpm_status{RTPM_OK};
  });
}

void rtpm_events_close(rtpm_events* events) {
  delete events;
}

int rtpm_events_descriptor(rtpm_events* events) {
  return events == nullptr ? -1 : events->descriptor;
}

rtpm_status rtpm_events_next(rtpm_events* events, int64_t timeout_us, rtpm_event* event) {
  return c::guarded([&] {
    if (events == nullptr || !c::has_size(event))
      return c::invalid("rtpm_events_next: events or event is NULL or not initialized");
    const std::lock_guard taking(events->taking);
    std::uint64_t lost_count = 0;
    {
      std::unique_lock lock(events->mutex);
      const auto has_news = [&] { return !events->waiting.empty() || events->is_ended; };
      events->changed.wait_for(lock, c::span_of_us(timeout_us), has_news);
      if (events->waiting.empty()) {
        events->settle();
        return events->is_ended ? c::failed(RTPM_ENDED, events->why_ended)
                                : c::failed(RTPM_NOTHING, "no event came in time");
      }
      events->given = std::move(events->waiting.front());
      events->byte_count -= events->given.payload.size();
      events->waiting.pop_front();
      events->settle();
      lost_count = events->dropped_count + events->lost_on_the_way;
    }
    c::give(event, in_c(*events, lost_count));
    return rtpm_status{RTPM_OK};
  });
}
