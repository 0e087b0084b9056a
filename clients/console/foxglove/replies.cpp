#include "foxglove/replies.hpp"

#include <utility>

namespace rtpm::console::foxglove {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint8_t kMessageOpcode = 1;
constexpr std::uint8_t kServiceCallResponseOpcode = 3;

Json json_of(const ChannelInfo& channel) {
  Json json{{"id", channel.id},
            {"topic", channel.topic},
            {"encoding", channel.encoding},
            {"schemaName", channel.schema_name},
            {"schema", channel.schema}};
  if (!channel.schema_encoding.empty()) json["schemaEncoding"] = channel.schema_encoding;
  return json;
}

Json json_of(const PayloadInfo& payload) {
  return {{"encoding", payload.encoding},
          {"schemaName", payload.schema_name},
          {"schemaEncoding", payload.schema_encoding},
          {"schema", payload.schema}};
}

/// The new and changed entries, each complete; a removed entry has no ids.
Json changed(const Graph::Ids& before, const Graph::Ids& after, const char* key) {
  Json list = Json::array();
  for (const auto& [name, ids] : after) {
    const auto known = before.find(name);
    if (known == before.end() || known->second != ids) list.push_back({{"name", name}, {key, ids}});
  }
  for (const auto& [name, ids] : before) {
    if (!after.contains(name)) list.push_back({{"name", name}, {key, Json::array()}});
  }
  return list;
}

std::set<std::string> topics_of(const Graph& graph) {
  std::set<std::string> topics;
  for (const auto& [name, ids] : graph.published_topics)
    topics.insert(name);
  for (const auto& [name, ids] : graph.subscribed_topics)
    topics.insert(name);
  return topics;
}

}  // namespace

std::string dumped(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string server_info(const ServerInfo& info) {
  return dumped({{"op", "serverInfo"},
                 {"name", info.name},
                 {"capabilities", info.capabilities},
                 {"supportedEncodings", info.encodings},
                 {"metadata", info.metadata},
                 {"sessionId", info.session_id}});
}

std::string status(StatusLevel level, std::string_view message) {
  return dumped({{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}});
}

std::string advertise(std::span<const ChannelInfo> channels) {
  Json list = Json::array();
  for (const ChannelInfo& channel : channels)
    list.push_back(json_of(channel));
  return dumped({{"op", "advertise"}, {"channels", std::move(list)}});
}

std::string unadvertise(std::span<const std::uint32_t> ids) {
  return dumped({{"op", "unadvertise"}, {"channelIds", ids}});
}

std::string advertise_services(std::span<const ServiceInfo> services) {
  Json list = Json::array();
  for (const ServiceInfo& service : services) {
    list.push_back({{"id", service.id},
                    {"name", service.name},
                    {"type", service.type},
                    {"request", json_of(service.request)},
                    {"response", json_of(service.response)}});
  }
  return dumped({{"op", "advertiseServices"}, {"services", std::move(list)}});
}

std::string unadvertise_services(std::span<const std::uint32_t> ids) {
  return dumped({{"op", "unadvertiseServices"}, {"serviceIds", ids}});
}

std::string parameter_values(std::span<const ParameterInfo> parameters,
                             const std::optional<std::string>& id) {
  Json list = Json::array();
  for (const ParameterInfo& parameter : parameters) {
    Json json{{"name", parameter.name}, {"value", parameter.value}};
    if (!parameter.type.empty()) json["type"] = parameter.type;
    list.push_back(std::move(json));
  }
  Json json{{"op", "parameterValues"}, {"parameters", std::move(list)}};
  if (id) json["id"] = *id;
  return dumped(json);
}

std::string graph_update(const Graph& before, const Graph& after) {
  Json removed_topics = Json::array();
  const std::set<std::string> topics = topics_of(after);
  for (const std::string& topic : topics_of(before)) {
    if (!topics.contains(topic)) removed_topics.push_back(topic);
  }
  Json removed_services = Json::array();
  for (const auto& [name, ids] : before.services) {
    if (!after.services.contains(name)) removed_services.push_back(name);
  }
  return dumped({{"op", "connectionGraphUpdate"},
                 {"publishedTopics",
                  changed(before.published_topics, after.published_topics, "publisherIds")},
                 {"subscribedTopics",
                  changed(before.subscribed_topics, after.subscribed_topics, "subscriberIds")},
                 {"advertisedServices", changed(before.services, after.services, "providerIds")},
                 {"removedTopics", std::move(removed_topics)},
                 {"removedServices", std::move(removed_services)}});
}

std::string service_call_failure(std::uint32_t service_id, std::uint32_t call_id,
                                 std::string_view message) {
  return dumped({{"op", "serviceCallFailure"},
                 {"serviceId", service_id},
                 {"callId", call_id},
                 {"message", message}});
}

std::array<std::byte, kMessageHeadSize> message_head(std::uint32_t subscription_id,
                                                     std::uint64_t log_time_ns) {
  std::array<std::byte, kMessageHeadSize> head{};
  ByteWriter writer(head);
  writer.put(kMessageOpcode);
  writer.put(subscription_id);
  writer.put(log_time_ns);
  return head;
}

std::string service_call_response(std::uint32_t service_id, std::uint32_t call_id,
                                  std::string_view encoding, ConstBytes payload) {
  std::string frame(13 + encoding.size() + payload.size(), '\0');
  ByteWriter writer(std::as_writable_bytes(std::span(frame)));
  writer.put(kServiceCallResponseOpcode);
  writer.put(service_id);
  writer.put(call_id);
  writer.put(static_cast<std::uint32_t>(encoding.size()));
  writer.put_bytes(std::as_bytes(std::span(encoding)));
  writer.put_bytes(payload);
  return frame;
}

}  // namespace rtpm::console::foxglove
