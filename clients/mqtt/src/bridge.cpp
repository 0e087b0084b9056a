#include "bridge.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace rtpm::mqtt {

using namespace events;

expected<std::unique_ptr<Bridge>, SetupError> Bridge::create(rpc::Node& node,
                                                             const BridgeConfig& config,
                                                             BrokerConfig broker) {
  std::unique_ptr<Bridge> bridge(new Bridge(config));
  if (auto begun = bridge->begin(node, std::move(broker)); !begun) {
    return unexpected{std::move(begun.error())};
  }
  return bridge;
}

expected<void, SetupError> Bridge::begin(rpc::Node& node, BrokerConfig broker) {
  const bool is_from_broker = config_.direction != Direction::kToBroker;
  if (is_from_broker) {
    auto supplier = Supplier::create(
        node, config_.hub,
        {.name = "mqtt", .priority = config_.priority, .deadline = config_.deadline});
    if (!supplier) return unexpected{std::move(supplier.error())};
    supplier_ = std::move(*supplier);
    broker.subscriptions.push_back(config_.prefix + "/+/+");
    for (const TopicMapping& each : config_.mappings)
      broker.subscriptions.push_back(each.topic);
  }
  // Messages may arrive before broker_ is set and while it is being destroyed: on_message() does
  // not use it.
  broker.id = id_;
  auto made = Broker::create(std::move(broker), *this);
  if (!made) return unexpected{std::move(made.error())};
  broker_ = std::move(*made);
  if (config_.direction == Direction::kFromBroker) return {};
  auto consumer = Consumer::create(node, config_.hub,
                                   {.name = "mqtt",
                                    .filter = filter(),
                                    .delivery = config_.delivery,
                                    .priority = config_.priority,
                                    .realtime = config_.realtime,
                                    .deadline = config_.deadline},
                                   *this);
  if (!consumer) return unexpected{std::move(consumer.error())};
  consumer_ = std::move(*consumer);
  return {};
}

Bridge::~Bridge() {
  // Destroyed in this order: consumer, broker, supplier.
  consumer_.reset();
  broker_.reset();
}

// ev-6.2-2: only events with hops left; a hub's own events have none.
Filter Bridge::filter() const {
  std::vector<Match> matches;
  for (const WantedOrigin& each : config_.wanted) {
    matches.push_back({.type = each.type,
                       .type_mask = kWholeNumber,
                       .source = each.source.value_or(0),
                       .source_mask = each.source ? kWholeNumber : 0,
                       .hops_min = 1});
  }
  if (matches.empty()) matches.push_back({.hops_min = 1});
  return listed(std::move(matches));
}

void Bridge::on_events(std::span<const EventView> events) {
  for (const EventView& event : events) {
    // ev-6.2-1
    if (event.header.supplier_tag != 0 && event.header.supplier_tag == own_tag_) {
      ++own_count_;
      continue;
    }
    broker_->publish(topic_of(config_.prefix, {event.header.type, event.header.source}),
                     event.payload, event.header.schema_id, event.header.hops_left);
    ++to_broker_count_;
  }
}

// Called before the first event after each start of the hub.
void Bridge::on_notice(const Notice& notice) {
  const bool is_begin =
      notice.kind == NoticeKind::kSubscribed || notice.kind == NoticeKind::kResubscribed;
  if (is_begin && supplier_) own_tag_ = supplier_tag_of(notice.hub_epoch, supplier_->id());
}

void Bridge::on_message(const Message& message) {
  // ev-6.2-1: a broker without "no local" returns our own messages.
  if (message.id == id_) {
    ++own_count_;
    return;
  }
  std::optional<Origin> origin = origin_of(config_.prefix, message.topic);
  const auto mapping = std::ranges::find(config_.mappings, message.topic, &TopicMapping::topic);
  if (mapping != config_.mappings.end()) origin = mapping->origin;
  // ev-6.1-1
  if (!origin) {
    ++unknown_topic_count_;
    return;
  }
  // ev-6.2-2
  const bool is_bridged = !message.id.empty();
  if (is_bridged && message.hops == 0) {
    ++hops_spent_count_;
    return;
  }
  const auto hops = is_bridged ? static_cast<std::uint8_t>(message.hops - 1) : config_.hops;
  const events::EventDraft event{.type = origin->type,
                                 .source = origin->source,
                                 .schema_id = message.schema_id,
                                 .payload = message.payload,
                                 .hops = hops};
  auto pushed = supplier_->push(event);
  // kMaybeLost concerns earlier events; this one was not sent.
  if (!pushed && pushed.error() == rpc::CallError::kMaybeLost) pushed = supplier_->push(event);
  ++(pushed ? pushed_count_ : push_failed_count_);
}

BridgeCounters Bridge::counters() const noexcept {
  return {to_broker_count_,     own_count_,        pushed_count_,
          unknown_topic_count_, hops_spent_count_, push_failed_count_};
}

std::string Bridge::report() const {
  const BridgeCounters bridge = counters();
  const BrokerCounters broker = broker_->counters();
  std::string text;
  const auto add = [&](const char* name, std::uint64_t count) {
    text += (text.empty() ? "" : " ") + std::string(name) + " " + std::to_string(count);
  };
  add("to_broker", bridge.to_broker_count);
  add("published", broker.published_count);
  add("overflow", broker.overflow_count);
  add("refused", broker.refused_count);
  add("received", broker.received_count);
  add("to_hub", bridge.pushed_count);
  add("failed", bridge.push_failed_count);
  if (supplier_) add("maybe_lost", supplier_->counters().maybe_lost_count);
  add("own", bridge.own_count);
  add("unknown_topic", bridge.unknown_topic_count);
  add("hops_spent", bridge.hops_spent_count);
  add("connections", broker.connection_count);
  if (consumer_) add("lost_at_hub", consumer_->counters().losses.total());
  return text;
}

}  // namespace rtpm::mqtt
