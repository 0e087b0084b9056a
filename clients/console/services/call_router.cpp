#include "services/call_router.hpp"

#include <algorithm>
#include <memory>
#include <span>
#include <utility>

#include "rtpm/base/nesting.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::console {
namespace {

constexpr std::size_t kBatchSize = 100;
/// This service never waits for other calls of its client.
constexpr std::string_view kStopService = "console/estop";

foxglove::PayloadInfo json_object(const std::string& name) {
  return {"json", name, "jsonschema", R"({"type":"object"})"};
}

}  // namespace

template <class Visit>
void CallRouter::for_commanding(const Visit& visit) {
  clients_.for_each([&](Client& client) {
    if (client.connection->may_command()) visit(client);
  });
}

void CallRouter::add(std::vector<foxglove::ServiceInfo> services, std::vector<Handler> handlers) {
  for (std::size_t i = 0; i < services.size(); ++i) {
    services[i].id = ++last_id_;
    ids_[services[i].name] = last_id_;
    services_[last_id_] = {services[i], std::move(handlers[i])};
  }
  const std::span all(services);
  for (std::size_t begin = 0; begin < all.size(); begin += kBatchSize) {
    const auto text = std::make_shared<const std::string>(
        foxglove::advertise_services(all.subspan(begin, std::min(kBatchSize, all.size() - begin))));
    for_commanding([&](Client& client) { client.connection->send_text(text); });
  }
}

void CallRouter::add_json(const std::string& name, JsonHandler handler) {
  foxglove::ServiceInfo info{.name = name, .type = name};
  info.request = json_object(name + ".Request");
  info.response = json_object(name + ".Response");
  add({std::move(info)},
      {[this, handler = std::move(handler)](const PendingCall& call, const std::string& payload) {
        if (call.encoding != "json") return fail(call, "the service takes the encoding json");
        const auto request = parse_bounded_json<nlohmann::json>(payload.empty() ? "{}" : payload);
        if (!request.is_object()) return fail(call, "the request is no JSON object");
        handler(call, request);
      }});
}

void CallRouter::remove(const std::vector<std::string>& names) {
  std::vector<std::uint32_t> ids;
  for (const std::string& name : names) {
    const auto found = ids_.find(name);
    if (found == ids_.end()) continue;
    ids.push_back(found->second);
    services_.erase(found->second);
    ids_.erase(found);
  }
  if (ids.empty()) return;
  const auto text = std::make_shared<const std::string>(foxglove::unadvertise_services(ids));
  for_commanding([&](Client& client) { client.connection->send_text(text); });
}

std::vector<std::string> CallRouter::names() const {
  std::vector<std::string> names;
  for (const auto& [name, id] : ids_)
    names.push_back(name);
  return names;
}

void CallRouter::advertise_to(Client& client) const {
  std::vector<foxglove::ServiceInfo> batch;
  const auto send = [&] {
    client.connection->send_text(
        std::make_shared<const std::string>(foxglove::advertise_services(batch)));
    batch.clear();
  };
  for (const auto& [id, service] : services_) {
    batch.push_back(service.info);
    if (batch.size() == kBatchSize) send();
  }
  if (!batch.empty()) send();
}

void CallRouter::call(Client& client, const foxglove::ServiceCall& call) {
  const PendingCall pending{client.connection->id(), call.service_id, call.call_id,
                            std::string(call.encoding)};
  const auto refuse = [&](std::string_view why) {
    clients_.send(pending.connection_id,
                  foxglove::service_call_failure(call.service_id, call.call_id, why));
  };
  if (!client.connection->may_command()) return refuse(client.connection->refusal());
  const auto service = services_.find(call.service_id);
  if (service == services_.end()) {
    return refuse("there is no service " + std::to_string(call.service_id));
  }
  if (pending.encoding != "json" && pending.encoding != "flatbuffer") {
    return refuse("the encoding '" + printable(pending.encoding, 32) +
                  "' is not spoken; send json or flatbuffer");
  }
  if (client.open_call_count >= kOpenCallCountMax && service->second.info.name != kStopService) {
    return refuse("too many calls of this connection are under way; wait for their answers");
  }
  ++client.open_call_count;
  // The handler may remove the service.
  const Handler handler = service->second.handler;
  handler(pending, {reinterpret_cast<const char*>(call.payload.data()), call.payload.size()});
}

void CallRouter::end(const PendingCall& call) {
  if (Client* const client = clients_.find(call.connection_id)) --client->open_call_count;
}

void CallRouter::succeed(const PendingCall& call, std::string_view payload) {
  end(call);
  clients_.send_binary(call.connection_id,
                       foxglove::service_call_response(call.service_id, call.call_id, call.encoding,
                                                       std::as_bytes(std::span(payload))));
}

void CallRouter::succeed(const PendingCall& call, const nlohmann::ordered_json& reply) {
  succeed(call, std::string_view(foxglove::dumped(reply)));
}

void CallRouter::fail(const PendingCall& call, std::string_view why) {
  end(call);
  clients_.send(call.connection_id,
                foxglove::service_call_failure(call.service_id, call.call_id, why));
}

}  // namespace rtpm::console
