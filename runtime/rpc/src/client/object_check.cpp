#include "client/object_check.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include "client/refused.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/interface_text.hpp"

namespace rtpm::rpc {
namespace {

// The first method that the server lacks or defines differently; null if all agree. A method
// missing from an incomplete list is not counted: a call will show it.
const MethodDescriptor* first_difference(const InterfaceDescriptor& ours,
                                         const wire::BindReply& reply,
                                         ConstBytes payload) noexcept {
  for (const MethodDescriptor& method : ours.methods) {
    bool is_same = !reply.is_method_list_complete;
    for (std::uint16_t i = 0; i < reply.method_count; ++i) {
      const wire::MethodEntry entry = wire::method_entry(payload, i);
      if (entry.id != method.id) continue;
      is_same = entry.fingerprint == method.fingerprint;
      break;
    }
    if (!is_same) return &method;
  }
  return nullptr;
}

CallOutcome call_session(CallChannel& channel, std::uint16_t method, Priority priority,
                         ConstBytes request, MonotonicTime deadline) noexcept {
  return channel.call({wire::kSessionService, method, priority, 0, deadline}, request, rt::now());
}

std::string words_of(const MethodDescriptor& method) {
  return "method '" + std::string(method.name) + "' (id " + std::to_string(method.id) +
         ") is missing or differs there";
}

// Why the server's different `method` prevents calls; empty if the two texts are compatible. Names
// the method if the server sent no description.
std::string obstacle(const InterfaceDescriptor& ours, const MethodDescriptor& method,
                     const CallOutcome& described) {
  const bool is_there =
      described.kind == CallOutcome::Kind::kReply && described.status == wire::Status::kOk;
  if (!is_there || ours.text.empty()) return words_of(method);
  const auto* const text = reinterpret_cast<const char*>(described.payload.data());
  return wire::find_obstacle(ours.text, {text, described.payload.size()}).value_or("");
}

}  // namespace

BindOutcome ask_for_object(const Destination& at, const InterfaceDescriptor& interface,
                           std::optional<std::uint64_t> known, CallChannel& channel,
                           Priority priority, MonotonicTime deadline) noexcept {
  std::array<std::byte, 512> request{};
  const std::size_t size =
      encode(wire::BindRequest{at.path, interface.name, interface.fingerprint}, request);
  RTPM_ASSERT(size > 0, "path and interface name fit a bind");
  const CallOutcome outcome =
      call_session(channel, wire::kMethodBind, priority, ConstBytes(request).first(size), deadline);
  BindOutcome result{outcome.kind, outcome.error, {}, outcome.status, {}, {}};
  if (outcome.kind != CallOutcome::Kind::kReply) return result;
  if (outcome.status != wire::Status::kOk) {
    result.error = refused(outcome.status, outcome.payload);
    if (outcome.status == wire::Status::kNoSuchObject) {
      const auto paths =
          outcome.payload.first(std::min(outcome.payload.size(), result.similar_paths.size()));
      std::ranges::copy(paths, result.similar_paths.begin());
      result.similar_paths_size = paths.size();
      return result;
    }
    const std::string_view other = ByteReader(outcome.payload).take_text();
    std::ranges::copy(other.substr(0, result.other_interface.size() - 1),
                      result.other_interface.begin());
    // An interface without a name is that of any object: asks by the name that the server gave.
    if (outcome.status == wire::Status::kWrongInterface && interface.name.empty() &&
        !other.empty()) {
      InterfaceDescriptor named = interface;
      named.name = result.other_interface.data();
      return ask_for_object(at, named, known, channel, priority, deadline);
    }
    return result;
  }
  const auto reply = wire::decode_bind_reply(outcome.payload);
  if (!reply) {
    result.kind = CallOutcome::Kind::kFailed;
    result.error = CallError::kBadReply;
    return result;
  }
  result.bound = {&at,
                  channel.server_epoch(),
                  reply->service,
                  reply->priority,
                  reply->is_server_declared,
                  reply->fingerprint};
  // hp-6.1-6: 0 means unknown.
  if (reply->fingerprint != 0 &&
      (reply->fingerprint == interface.fingerprint || known == reply->fingerprint)) {
    return result;
  }
  // hp-6.1-2: a server may have additional methods; the methods that we know must agree.
  const MethodDescriptor* const method = first_difference(interface, *reply, outcome.payload);
  if (method == nullptr) return result;
  std::array<std::byte, wire::kDescribeRequestSize> object{};
  wire::encode_describe_request(reply->service, object);
  const CallOutcome described =
      call_session(channel, wire::kMethodDescribe, priority, object, deadline);
  if (described.kind != CallOutcome::Kind::kReply) {
    result.kind = described.kind;
    result.error = described.error;
    return result;
  }
  result.difference = obstacle(interface, *method, described);
  if (!result.difference.empty()) {
    result.status = wire::Status::kWrongInterface;
    result.error = CallError::kNoSuchMethod;
  }
  return result;
}

}  // namespace rtpm::rpc
