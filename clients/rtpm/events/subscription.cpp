#include "events/subscription.hpp"

#include <utility>

#include "cli/command.hpp"
#include "objects/unbound.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/hub_recorder.hpp"
#include "rtpm/events/filter_text.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

using events::EventDescriptor;

}  // namespace

void add_event_options(CLI::App& command, EventRequest& request) {
  command.add_option("--hub", request.hub, "The hub, by name or URL")->capture_default_str();
  command
      .add_option("--filter", request.filter,
                  "Which events: 'type(lab.Touched) and force.z > 2', see FILTERS.md")
      ->capture_default_str();
  add_count(command, "--every", request.every_nth, "Only the first event, and then every Nth", 1u,
            1'000'000'000u);
  add_duration(command, "--for", request.time, "How long; without: until Ctrl-C",
               {Duration{0}, std::chrono::hours{24 * 365}});
}

std::unique_ptr<Subscription> Subscription::open(Context& context, const EventRequest& request,
                                                 Observer& observer, int& exit_code) {
  const Duration deadline = context.deadline.value_or(std::chrono::seconds{1});
  auto types = events::HubTypes::ask(context.node(), request.hub, deadline);
  if (!types) {
    exit_code = context.not_reached(with_similar_names(context, request.hub, types.error()));
    return nullptr;
  }
  const auto filter = events::parse_filter(request.filter, types->list());
  if (!filter) {
    exit_code = context.fail_at("filter", request.filter, filter.error());
    return nullptr;
  }
  std::unique_ptr<Subscription> opened(
      new Subscription(context, request.hub, observer, std::move(*types)));
  events::ConsumerConfig config{.name = "rtpm", .filter = *filter};
  config.delivery.every_nth = request.every_nth;
  config.delivery.queue_capacity = events::kQueueCapacityMax;
  config.realtime = rt::RealtimeMode::kOff;
  config.priority = context.priority.value_or(Priority{});
  config.deadline = deadline;
  auto consumer = events::Consumer::create(context.node(), request.hub, config, *opened);
  if (!consumer) {
    exit_code = context.fail(consumer.error());
    return nullptr;
  }
  opened->consumer_ = std::move(*consumer);
  return opened;
}

Subscription::Subscription(Context& context, std::string hub, Observer& observer,
                           events::HubTypes types) noexcept
    : context_(context), hub_(std::move(hub)), observer_(observer), types_(std::move(types)) {}

Subscription::~Subscription() {
  end();
}

void Subscription::care() {
  bool lacks_type = false;
  std::string notice;
  {
    const std::lock_guard lock(mutex_);
    lacks_type = std::exchange(lacks_type_, false);
    notice = std::exchange(notice_, {});
  }
  if (!notice.empty()) rt::print_error("rtpm", notice);
  if (!lacks_type) return;
  auto types = events::HubTypes::ask(context_.node(), hub_);
  const std::lock_guard lock(mutex_);
  if (types) types_ = std::move(*types);
}

void Subscription::end() {
  consumer_.reset();  // Until this returns, the consumer may call the observer.
}

std::uint64_t Subscription::lost_count() const {
  const events::Losses losses = consumer_->counters().losses;
  return losses.total() - losses.suspended_count;
}

void Subscription::on_events(std::span<const events::EventView> events) {
  const std::lock_guard lock(mutex_);
  for (const events::EventView& event : events) {
    const EventDescriptor* const type = types_.find(event.header.type);
    lacks_type_ = lacks_type_ || (type == nullptr && event.header.type <= events::kEventTypeMax);
    observer_.on_event(event, type);
  }
}

void Subscription::on_notice(const events::Notice& notice) {
  std::string text = capture::text_of(notice, hub_);
  const std::lock_guard lock(mutex_);
  if (!text.empty()) notice_ = std::move(text);
}

}  // namespace rtpm::tool
