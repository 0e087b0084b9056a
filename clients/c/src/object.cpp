#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "guard.hpp"
#include "node.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/names/directory.hpp"

using namespace rtpm;

/// An object whose schema its server publishes.
struct rtpm_object {
  std::string name;
  std::unique_ptr<dynamic::RemoteObject> remote;
  std::mutex mutex{};  ///< JSON is converted by one thread at a time.
};

namespace {

rpc::CallOptions calls_within(std::int64_t timeout_us) {
  rpc::CallOptions options;
  if (timeout_us > 0) options.deadline = c::span_of_us(timeout_us);
  return options;
}

/// The method; nullptr after a status if it can't be called so.
const schema::Method* find(rtpm_object& object, const char* method, rtpm_status& status) {
  const schema::Method* const found = object.remote->dynamic().find(method);
  if (found == nullptr)
    status = c::failed(RTPM_REFUSED, object.name + " has no method '" + method + "'");
  else if (found->is_stream)
    status = c::failed(RTPM_REFUSED, std::string(method) + " is a stream, which C can't read");
  return status == RTPM_OK ? found : nullptr;
}

}  // namespace

rtpm_status rtpm_object_open(rtpm_node* node, const char* name, rtpm_object** object) {
  return c::guarded([&] {
    if (node == nullptr || name == nullptr || object == nullptr)
      return c::invalid("rtpm_object_open: node, name and object must not be NULL");
    const auto url = names::url_of(node->node, node->where, name);
    if (!url) return c::failed(url.error(), RTPM_UNREACHABLE);
    auto remote = dynamic::RemoteObject::open(node->node, *url);
    if (!remote) return c::failed(remote.error(), RTPM_UNREACHABLE);
    *object = new rtpm_object{name, std::move(*remote)};
    return rtpm_status{RTPM_OK};
  });
}

void rtpm_object_close(rtpm_object* object) {
  delete object;
}

rtpm_status rtpm_object_call(rtpm_object* object, const char* method, const char* request,
                             int64_t timeout_us, char** reply) {
  return c::guarded([&] {
    if (object == nullptr || method == nullptr || request == nullptr)
      return c::invalid("rtpm_object_call: object, method and request must not be NULL");
    rtpm_status status = RTPM_OK;
    const schema::Method* found = nullptr;
    std::optional<std::vector<std::byte>> bytes;
    std::string error;
    {
      const std::lock_guard lock(object->mutex);
      found = find(*object, method, status);
      if (found == nullptr) return status;
      bytes = object->remote->dynamic().encode(found->request, request, error);
    }
    if (!bytes) return c::invalid("the request does not fit the schema: " + error);
    const auto answer = object->remote->call_bytes(*found, *bytes, calls_within(timeout_us));
    if (!answer) return c::failed(object->name + ": " + method, answer.error());
    if (reply == nullptr) return status;
    std::optional<std::string> text = "";
    if (!found->oneway) {
      const std::lock_guard lock(object->mutex);
      text = object->remote->dynamic().decode(found->reply, *answer);
    }
    if (!text) return c::failed(RTPM_FAILED, std::string(method) + ": the reply is malformed");
    return c::give_text(*text, reply);
  });
}

rtpm_status rtpm_object_call_bytes(rtpm_object* object, const char* method, const void* request,
                                   size_t request_size, int64_t timeout_us, void** reply,
                                   size_t* reply_size) {
  return c::guarded([&] {
    const bool has_request = request != nullptr || request_size == 0;
    if (object == nullptr || method == nullptr || !has_request || !reply || !reply_size)
      return c::invalid("rtpm_object_call_bytes: no argument may be NULL");
    rtpm_status status = RTPM_OK;
    const schema::Method* const found = find(*object, method, status);
    if (found == nullptr) return status;
    const ConstBytes bytes(static_cast<const std::byte*>(request), request_size);
    const auto answer = object->remote->call_bytes(*found, bytes, calls_within(timeout_us));
    if (!answer) return c::failed(object->name + ": " + method, answer.error());
    *reply_size = answer->size();
    return c::give_bytes(*answer, reply);
  });
}
