#include "foxglove/requests.hpp"

#include <limits>
#include <utility>

#include "rtpm/base/nesting.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::console::foxglove {
namespace {

constexpr std::size_t kNameSizeMax = 1024;
constexpr std::uint8_t kClientMessageOpcode = 1;
constexpr std::uint8_t kServiceCallOpcode = 2;

unexpected<std::string> fault(const std::string& op, const std::string& what) {
  return {op + ": " + what};
}

std::optional<std::uint32_t> id_in(const nlohmann::json& value) {
  if (!value.is_number_integer()) return std::nullopt;
  if (!value.is_number_unsigned() && value.get<std::int64_t>() < 0) return std::nullopt;
  const auto number = value.get<std::uint64_t>();
  if (number > std::numeric_limits<std::uint32_t>::max()) return std::nullopt;
  return static_cast<std::uint32_t>(number);
}

std::optional<std::uint32_t> id_of(const nlohmann::json& object, const char* key) {
  if (!object.is_object()) return std::nullopt;
  const auto found = object.find(key);
  return found == object.end() ? std::nullopt : id_in(*found);
}

std::optional<std::string> text_of(const nlohmann::json& object, const char* key) {
  if (!object.is_object()) return std::nullopt;
  const auto found = object.find(key);
  if (found == object.end() || !found->is_string()) return std::nullopt;
  const auto& text = found->get_ref<const std::string&>();
  if (text.size() > kNameSizeMax) return std::nullopt;
  return text;
}

/// The list `key` of the request; nullptr if there is none or it is too long.
const nlohmann::json* list_of(const nlohmann::json& request, const char* key) {
  const auto found = request.find(key);
  if (found == request.end() || !found->is_array() || found->size() > kListSizeMax) return nullptr;
  return &*found;
}

std::optional<std::vector<std::string>> names_of(const nlohmann::json& request) {
  std::vector<std::string> names;
  const nlohmann::json* const list = list_of(request, "parameterNames");
  if (list == nullptr) return std::nullopt;
  for (const nlohmann::json& name : *list) {
    if (!name.is_string()) return std::nullopt;
    const auto& text = name.get_ref<const std::string&>();
    if (text.size() > kNameSizeMax) return std::nullopt;
    names.push_back(text);
  }
  return names;
}

expected<TextRequest, std::string> read_subscribe(const nlohmann::json& request) {
  const nlohmann::json* const list = list_of(request, "subscriptions");
  if (list == nullptr) return fault("subscribe", "needs a list `subscriptions`");
  Subscribe subscribe;
  for (const nlohmann::json& one : *list) {
    const auto id = id_of(one, "id");
    const auto channel = id_of(one, "channelId");
    if (!id || !channel) return fault("subscribe", "each needs `id` and `channelId`, 0 to 2^32-1");
    subscribe.subscriptions.push_back({*id, *channel});
  }
  return subscribe;
}

expected<TextRequest, std::string> read_unsubscribe(const nlohmann::json& request) {
  const nlohmann::json* const list = list_of(request, "subscriptionIds");
  if (list == nullptr) return fault("unsubscribe", "needs a list `subscriptionIds`");
  Unsubscribe unsubscribe;
  for (const nlohmann::json& one : *list) {
    const auto id = id_in(one);
    if (!id) return fault("unsubscribe", "an id is a number of 0 to 2^32-1");
    unsubscribe.subscription_ids.push_back(*id);
  }
  return unsubscribe;
}

expected<TextRequest, std::string> read_get_parameters(const nlohmann::json& request) {
  auto names = names_of(request);
  if (!names) return fault("getParameters", "needs a list of names `parameterNames`");
  return GetParameters{std::move(*names), text_of(request, "id")};
}

expected<TextRequest, std::string> read_set_parameters(const nlohmann::json& request,
                                                       bool may_command) {
  const nlohmann::json* const list = list_of(request, "parameters");
  if (list == nullptr) return fault("setParameters", "needs a list `parameters`");
  SetParameters set;
  set.id = text_of(request, "id");
  for (const nlohmann::json& one : *list) {
    auto name = text_of(one, "name");
    if (!name) return fault("setParameters", "each parameter needs a `name`");
    set.parameters.push_back({std::move(*name),
                              may_command ? one.value("value", nlohmann::json{}) : nlohmann::json{},
                              text_of(one, "type").value_or(std::string{})});
  }
  return set;
}

expected<TextRequest, std::string> read_watch_parameters(const nlohmann::json& request,
                                                         const std::string& op, bool is_watching) {
  auto names = names_of(request);
  if (!names) return fault(op, "needs a list of names `parameterNames`");
  return WatchParameters{std::move(*names), is_watching};
}

}  // namespace

expected<TextRequest, std::string> read_text(std::string_view text, bool may_command) {
  if (!is_json_nested_within(text, kNestingMax)) {
    return unexpected{"a text frame nests deeper than " + std::to_string(kNestingMax)};
  }
  const nlohmann::json request = parse_bounded_json<nlohmann::json>(text);
  if (!request.is_object()) return unexpected{std::string("a text frame is no JSON object")};
  const auto op = text_of(request, "op");
  if (!op) return unexpected{std::string("a text frame has no `op`")};
  if (*op == "subscribe") return read_subscribe(request);
  if (*op == "unsubscribe") return read_unsubscribe(request);
  if (*op == "getParameters") return read_get_parameters(request);
  if (*op == "setParameters") return read_set_parameters(request, may_command);
  if (*op == "subscribeParameterUpdates") return read_watch_parameters(request, *op, true);
  if (*op == "unsubscribeParameterUpdates") return read_watch_parameters(request, *op, false);
  if (*op == "subscribeConnectionGraph") return WatchGraph{true};
  if (*op == "unsubscribeConnectionGraph") return WatchGraph{false};
  if (*op == "advertise" || *op == "unadvertise" || *op == "fetchAsset") return Unsupported{*op};
  return unexpected{"unknown op '" + printable(*op, 64) + "'"};
}

expected<ServiceCall, std::string> read_binary(ConstBytes frame) {
  ByteReader reader(frame);
  const auto opcode = reader.take<std::uint8_t>();
  if (!reader.ok()) return unexpected{std::string("a binary frame is empty")};
  if (opcode == kClientMessageOpcode) {
    return unexpected{std::string("this server takes no messages of clients (clientPublish)")};
  }
  if (opcode != kServiceCallOpcode) {
    return unexpected{"unknown binary opcode " + std::to_string(opcode)};
  }
  ServiceCall call;
  call.service_id = reader.take<std::uint32_t>();
  call.call_id = reader.take<std::uint32_t>();
  const ConstBytes encoding = reader.take_bytes(reader.take<std::uint32_t>());
  if (!reader.ok()) return unexpected{std::string("a service call is cut off")};
  call.encoding = {reinterpret_cast<const char*>(encoding.data()), encoding.size()};
  call.payload = reader.take_bytes(reader.left());
  return call;
}

}  // namespace rtpm::console::foxglove
