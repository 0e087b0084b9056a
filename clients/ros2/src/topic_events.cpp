#include "topic_events.hpp"

#include <ros2_events.rtpm.events.hpp>
#include <utility>

#include "rtpm/gvd/device_event.hpp"
#include "rtpm/rpc/tables.hpp"

namespace rtpm::ros2 {
namespace {

/// With topic and type it fits into an event.
constexpr std::uint32_t kEventSizeMax = 60'000;
/// Best effort matches publishers of both kinds.
constexpr Quality kAll{.reliability = Reliability::kBestEffort, .depth = 100};

bool is_type_name(std::string_view text) {
  return text.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_/") ==
         std::string_view::npos;
}

}  // namespace

expected<Topic, SetupError> parse_topic(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  const std::string_view name = text.substr(0, colon);
  std::string type(colon == std::string_view::npos ? "" : text.substr(colon + 1));
  const std::size_t slash = type.find('/');
  if (slash != std::string::npos && type.find('/', slash + 1) == std::string::npos)
    type.insert(slash, "/msg");
  if (!name.starts_with('/') || !is_type_name(name) || name.size() > 200 ||
      slash == std::string::npos || !is_type_name(type) || type.size() > 200) {
    return setup_error("'" + std::string(text) + "' is no topic with its type",
                       "write it as /camera/trigger:std_msgs/msg/Header");
  }
  return Topic{.name = std::string(name), .type = std::move(type)};
}

expected<std::unique_ptr<TopicEvents>, SetupError> TopicEvents::create(
    rpc::Node& node, Participant& participant, const std::string& hub,
    const std::vector<Topic>& topics) {
  auto supplier = events::Supplier::create(
      node, hub, {.name = "ros2", .types = {&MessageReceivedEvent::kDescriptor}});
  if (!supplier) return unexpected{std::move(supplier.error())};
  std::unique_ptr<TopicEvents> passing(new TopicEvents(std::move(*supplier)));
  for (const Topic& topic : topics) {
    auto made = participant.subscribe(
        topic, kAll, kEventSizeMax,
        [its = passing.get(), topic](const Received& message) { its->push(topic, message); });
    if (!made) return unexpected{std::move(made.error())};
    passing->subscriptions_.push_back(std::move(*made));
  }
  return passing;
}

void TopicEvents::push(const Topic& topic, const Received& message) {
  if (message.cdr.empty()) {
    ++failed_count_;
    return;
  }
  flatbuffers::FlatBufferBuilder builder;
  const auto cdr = builder.CreateVector(reinterpret_cast<const std::uint8_t*>(message.cdr.data()),
                                        message.cdr.size());
  const auto name = builder.CreateString(topic.name);
  const auto type = builder.CreateString(topic.type);
  builder.Finish(CreateMessageReceived(builder, name, type, message.source_time_ns, cdr));
  const events::EventDraft event{.type = MessageReceivedEvent::kType,
                                 .source = gvd::source_of(topic.name),
                                 .schema_id = MessageReceivedEvent::kSchemaId,
                                 .payload = rpc::table_bytes(builder)};
  auto pushed = supplier_->push(event);
  // kMaybeLost concerns earlier events; this one was not sent.
  if (!pushed && pushed.error() == rpc::CallError::kMaybeLost) pushed = supplier_->push(event);
  ++(pushed ? pushed_count_ : failed_count_);
}

std::uint64_t TopicEvents::lost_count() const {
  std::uint64_t count = failed_count_ + supplier_->counters().maybe_lost_count;
  for (const auto& each : subscriptions_)
    count += each->lost_count();
  return count;
}

}  // namespace rtpm::ros2
