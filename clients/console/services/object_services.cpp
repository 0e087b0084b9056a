#include "services/object_services.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>

#include "foxglove/base64.hpp"
#include "foxglove/strict_json.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/base/nesting.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

constexpr std::string_view kDeviceInterface = "rtpm.device.Device";
/// The interval before opening an object is retried.
constexpr Duration kRetryInterval = std::chrono::seconds{5};
/// The longest time that an object's method may occupy a worker.
constexpr Duration kDeadlineMax = std::chrono::seconds{10};

/// Whether a method makes a device act, and so requires an operator.
bool is_command(std::string_view method) {
  constexpr std::array kCommands{"command",  "acquire",    "renew", "release",    "recover",
                                 "activate", "deactivate", "rearm", "set_models", "take_over"};
  return std::ranges::count(kCommands, method) > 0;
}

foxglove::PayloadInfo info_of(const schema::Dynamic& dynamic, const schema::Payload& payload) {
  return {"flatbuffer", dynamic.model().objects[payload.table].name, "flatbuffer",
          foxglove::to_base64(dynamic.reflection_of(payload))};
}

const schema::Field* lease_field(const schema::Object& object) {
  const auto found = std::ranges::find(object.fields, "lease", &schema::Field::name);
  const bool is_there =
      found != object.fields.end() && found->type.base == schema::BaseType::kUint64;
  return is_there ? &*found : nullptr;
}

/// Encodes a client's request for the wire.
/// @errors   described in words: it does not match the schema
expected<std::vector<std::byte>, std::string> encoded(schema::Dynamic& dynamic,
                                                      const schema::Payload& payload, bool is_json,
                                                      const std::string& request) {
  if (!is_json) {
    auto bytes = dynamic.from_table(payload, std::as_bytes(std::span(request)));
    if (bytes) return std::move(*bytes);
    return unexpected{"the request is no FlatBuffer of " +
                      dynamic.model().objects[payload.table].name};
  }
  // The schema's own parser also accepts declarations, so it must only get JSON.
  const auto json = parse_bounded_json<nlohmann::json>(request.empty() ? "{}" : request);
  if (!json.is_object()) return unexpected{std::string("the request is no JSON object")};
  std::string error;
  auto bytes = dynamic.encode(payload, json.dump(), error);
  if (bytes) return std::move(*bytes);
  return unexpected{"the request does not fit the schema: " + error};
}

/// Inserts the console's lease if the request has none.
std::vector<std::byte> with_lease(schema::Dynamic& dynamic, const schema::Payload& payload,
                                  std::vector<std::byte> bytes, std::uint64_t lease) {
  if (lease == 0 || payload.kind == schema::PayloadKind::kEmpty) return bytes;
  const bool is_struct = payload.kind == schema::PayloadKind::kStruct;
  const schema::Object& object =
      dynamic.model().objects[is_struct ? *payload.struct_index : payload.table];
  const schema::Field* const field = lease_field(object);
  if (field == nullptr) return bytes;
  if (is_struct) {
    if (bytes.size() < field->offset + sizeof lease) return bytes;
    std::byte* const at = bytes.data() + field->offset;
    if (load_le<std::uint64_t>(at) == 0) store_le(at, lease);
    return bytes;
  }
  const auto text = dynamic.decode(payload, bytes);
  auto json = parse_bounded_json<nlohmann::json>(text.value_or("{}"));
  if (!text || !json.is_object() || json.value("lease", std::uint64_t{0}) != 0) return bytes;
  json["lease"] = lease;
  std::string error;
  auto patched = dynamic.encode(payload, json.dump(), error);
  return patched ? std::move(*patched) : bytes;
}

}  // namespace

ObjectServices::ObjectServices(rpc::Node& node, CallRouter& router, OperatorDesk& desk,
                               WorkerPool& pool, WorkerPool& background, Post post,
                               std::function<std::shared_ptr<DeviceLink>(const std::string&)> links)
    : node_(node),
      router_(router),
      desk_(desk),
      pool_(pool),
      background_(background),
      post_(std::move(post)),
      links_(std::move(links)) {}

void ObjectServices::set_objects(const std::vector<ObjectView>& objects) {
  std::erase_if(entries_, [&](const auto& one) {
    const bool is_gone = !std::ranges::count(objects, one.second.view);
    if (is_gone) remove(one.second);
    return is_gone;
  });
  for (const ObjectView& object : objects) {
    Entry& entry = entries_[object.name];
    entry.view = object;
    if (!entry.opened && !entry.is_opening && rt::now() >= entry.next) open(entry);
  }
}

void ObjectServices::open(Entry& entry) {
  entry.is_opening = true;
  entry.next = rt::now() + kRetryInterval;
  const bool is_queued = background_.run("open " + entry.view.url, [this, view = entry.view] {
    auto opened = std::make_shared<Opened>();
    if (auto remote = dynamic::RemoteObject::open(node_, view.url)) {
      opened->remote = std::move(*remote);
      schema::Dynamic& dynamic = opened->remote->dynamic();
      for (const schema::Method& method : dynamic.service().methods) {
        // A stream does not fit the pattern of one request and one reply.
        if (method.is_stream) continue;
        const std::string name = view.name + "/" + method.name;
        opened->methods.push_back(&method);
        opened->services.push_back({.name = name,
                                    .type = name,
                                    .request = info_of(dynamic, method.request),
                                    .response = info_of(dynamic, method.reply)});
      }
    }
    post_([this, view, opened] {
      const auto found = entries_.find(view.name);
      if (found == entries_.end() || found->second.view != view) return;
      found->second.is_opening = false;
      if (!opened->remote) return;
      found->second.opened = opened;
      add(view.name, opened);
    });
  });
  if (!is_queued) entry.is_opening = false;
}

void ObjectServices::add(const std::string& name, const std::shared_ptr<Opened>& opened) {
  std::vector<CallRouter::Handler> handlers;
  const ObjectView view = entries_[name].view;
  for (const schema::Method* const method : opened->methods) {
    handlers.emplace_back(
        [this, view, opened, method](const PendingCall& pending, std::string payload) {
          call(view, opened, *method, pending, std::move(payload));
        });
  }
  router_.add(opened->services, std::move(handlers));
}

void ObjectServices::remove(const Entry& entry) {
  if (!entry.opened) return;
  std::vector<std::string> names;
  for (const foxglove::ServiceInfo& service : entry.opened->services)
    names.push_back(service.name);
  router_.remove(names);
}

void ObjectServices::call(const ObjectView& view, const std::shared_ptr<Opened>& opened,
                          const schema::Method& method, const PendingCall& call,
                          std::string payload) {
  std::shared_ptr<DeviceLink> link;
  if (view.interface == kDeviceInterface) {
    link = links_(view.name);
    if (is_command(method.name)) {
      const std::string why = desk_.refusal(call.connection_id, view.name, false);
      if (!why.empty()) return router_.fail(call, why);
    }
  }
  const bool is_queued = pool_.run(view.url, [=, this, &method, payload = std::move(payload)] {
    const auto fail = [&](const std::string& why) {
      post_([this, call, why] { router_.fail(call, why); });
    };
    schema::Dynamic& dynamic = opened->remote->dynamic();
    const bool is_json = call.encoding == "json";
    std::vector<std::byte> request;
    {
      const std::lock_guard lock(opened->mutex);
      auto bytes = encoded(dynamic, method.request, is_json, payload);
      if (!bytes) return fail(bytes.error());
      request = with_lease(dynamic, method.request, std::move(*bytes), link ? link->lease() : 0);
    }
    rpc::CallOptions options;
    if (method.deadline_us) {
      options.deadline =
          std::min(Duration{std::chrono::microseconds{*method.deadline_us}}, kDeadlineMax);
    }
    const auto reply = opened->remote->call_bytes(method, request, options);
    if (!reply) return fail(view.name + ": " + rpc::describe(reply.error()));
    std::optional<std::string> answer;
    {
      const std::lock_guard lock(opened->mutex);
      if (is_json) {
        if (const auto text = dynamic.decode(method.reply, *reply)) {
          answer = foxglove::strict_json(*text);
        }
      } else if (const auto table = dynamic.as_table(method.reply, *reply)) {
        answer.emplace(reinterpret_cast<const char*>(table->data()), table->size());
      }
    }
    if (!answer) return fail(view.name + ": the reply does not fit the schema");
    post_([this, call, answer = std::move(*answer)] {
      router_.succeed(call, std::string_view(answer));
    });
  });
  if (!is_queued) router_.fail(call, "too much waits to be done; try again");
}

}  // namespace rtpm::console
