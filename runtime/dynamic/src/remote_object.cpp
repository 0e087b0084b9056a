#include "rtpm/dynamic/remote_object.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/status.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::dynamic {
namespace {

/// Includes the server's text.
unexpected<SetupError> call_failed(std::string what, rpc::CallError error) {
  return {{std::move(what), rpc::describe(error), {}, error}};
}

// The error for an object that the server's catalog lacks.
SetupError not_in_catalog(rpc::Node& node, const std::string& url) {
  // The server's error lists similar objects.
  static const rpc::InterfaceDescriptor kAnything{};
  const auto bound = rpc::Binding::bind(node, url, kAnything);
  if (!bound && bound.error().cause == rpc::CallError::kNoSuchObject) return bound.error();
  return {"the server's catalog does not contain " + url,
          {},
          "add it there (rtpm::introspection::Catalog::add)"};
}

// Explains why the server's catalog could not be queried.
SetupError not_asked(const wire::Url& url, SetupError error) {
  const auto is = [&](rpc::CallError cause) { return error.cause == cause; };
  const bool is_silence = is(rpc::CallError::kUnreachable) || is(rpc::CallError::kTimeout) ||
                          is(rpc::CallError::kExpired) || is(rpc::CallError::kDisconnected);
  const std::string server = "the server of " + printable(url.text());
  error.why = error.reason();
  error.what = server + (is_silence ? " does not answer" : " can't be asked for its objects");
  return error;
}

// How often a silent stream checks whether to end.
constexpr Duration kLookInterval = std::chrono::milliseconds{100};

wire::Delivery delivery_of(schema::OnewayLevel level) noexcept {
  switch (level) {
    case schema::OnewayLevel::kSent:
      return wire::Delivery::kSent;
    case schema::OnewayLevel::kReceived:
      return wire::Delivery::kReceipt;
    case schema::OnewayLevel::kDone:
      break;
  }
  return wire::Delivery::kReply;
}

}  // namespace

std::string catalog_url(const std::string& url) {
  auto parts = wire::parse_url(url);
  if (!parts) return {};
  parts->path = introspection::kPath;
  return parts->text();
}

expected<Description, SetupError> describe(rpc::Node& node, const std::string& url) {
  const auto parts = wire::parse_url(url);
  if (!parts) return setup_error("'" + url + "' is no URL", "", "write rtpm://host:port/path");
  auto catalog = introspection::IntrospectionClient::bind(node, catalog_url(url));
  if (!catalog && catalog.error().cause == rpc::CallError::kNoSuchObject) {
    return setup_error(
        "the server describes none of its objects (for that it needs an "
        "rtpm::introspection::Catalog)",
        catalog.error());
  }
  if (!catalog) return unexpected{not_asked(*parts, catalog.error())};
  introspection::DescribeRequestT request;
  request.path = parts->path;
  const auto description = catalog->describe(request);
  if (!description && description.error() == rpc::CallError::kNoSuchObject) {
    return unexpected{not_in_catalog(node, url)};
  }
  if (!description) return setup_error("the description of " + url, description.error());
  return Description{.interface = (*description)->interface()->str(),
                     .schema = (*description)->schema()->str(),
                     .compiler_version = (*description)->compiler_version()->str()};
}

expected<std::unique_ptr<RemoteObject>, SetupError> RemoteObject::open(rpc::Node& node,
                                                                       const std::string& url) {
  auto description = describe(node, url);
  if (!description) return unexpected{std::move(description.error())};
  auto object = std::unique_ptr<RemoteObject>(new RemoteObject);
  object->schema_ = std::move(description->schema);
  object->compiler_version_ = printable(description->compiler_version);
  std::string error;
  object->dynamic_ = schema::Dynamic::make(object->schema_, description->interface, error);
  if (!object->dynamic_) {
    return setup_error(
        "the schema of " + url + ", by rtpmc " + object->compiler_version_ + ", can't be read",
        error);
  }
  const schema::Service& service = object->dynamic_->service();
  for (const schema::Method& method : service.methods) {
    object->methods_.push_back(
        {.id = method.id,
         .name = method.name,
         .fingerprint = method.fingerprint,
         .is_idempotent = method.is_idempotent,
         .default_deadline = std::chrono::microseconds{method.deadline_us.value_or(0)}});
  }
  object->interface_ = {.name = service.name,
                        .fingerprint = service.fingerprint,
                        .compiler_version = object->compiler_version_,
                        .methods = object->methods_};
  auto binding = rpc::Binding::bind(node, url, object->interface_);
  if (!binding) return unexpected{std::move(binding.error())};
  object->binding_ = std::make_unique<rpc::Binding>(std::move(*binding));
  return object;
}

expected<void, SetupError> RemoteObject::call(std::string_view method, std::string_view json,
                                              const rpc::CallOptions& options,
                                              std::optional<Duration> stream_time,
                                              const Print& print) {
  const schema::Method* found = dynamic_->find(method);
  if (found == nullptr) {
    std::string text;
    std::vector<std::string> names;
    for (const schema::Method& candidate : dynamic_->service().methods) {
      text += (text.empty() ? "" : ", ") + candidate.name;
      names.push_back(candidate.name);
    }
    return setup_error(dynamic_->service().name + " has no method `" + std::string(method) + "`" +
                       program::suggestion(method, names) + "; it has " + text);
  }
  std::string error;
  const auto request = dynamic_->encode(found->request, json, error);
  if (!request) return setup_error("the request does not fit the schema", error);
  const std::string failed = "`" + found->name + "` gave no result";
  const rpc::MethodDescriptor& called =
      methods_[static_cast<std::size_t>(found - dynamic_->service().methods.data())];
  if (found->oneway) {
    const auto sent = binding_->send(called, *request, delivery_of(*found->oneway), options);
    if (!sent) return call_failed(failed, sent.error());
    return {};
  }
  if (found->is_stream) {
    rpc::StreamOptions stream{.call = options};
    // The client decides when the stream ends.
    stream.call.deadline.reset();
    auto reader = binding_->open_stream(called, *request, stream);
    if (!reader) return call_failed(failed, reader.error());
    return take_items(*found, *reader, stream_time, print);
  }
  const auto reply = binding_->call(called, *request, options);
  if (!reply) return call_failed(failed, reply.error());
  bool goes_on = true;
  return print_payload(found->reply, reply->bytes(), goes_on, print);
}

expected<std::vector<std::byte>, rpc::CallError> RemoteObject::call_bytes(
    const schema::Method& method, ConstBytes request, const rpc::CallOptions& options) {
  const rpc::MethodDescriptor& called =
      methods_[static_cast<std::size_t>(&method - dynamic_->service().methods.data())];
  if (method.oneway) {
    const auto sent = binding_->send(called, request, delivery_of(*method.oneway), options);
    if (!sent) return unexpected{sent.error()};
    return std::vector<std::byte>{};
  }
  const auto reply = binding_->call(called, request, options);
  if (!reply) return unexpected{reply.error()};
  const ConstBytes bytes = reply->bytes();
  return std::vector<std::byte>(bytes.begin(), bytes.end());
}

expected<void, SetupError> RemoteObject::take_items(const schema::Method& method,
                                                    rpc::ItemReader& reader,
                                                    std::optional<Duration> stream_time,
                                                    const Print& print) {
  const MonotonicTime end = stream_time ? rt::now() + *stream_time : kNever;
  for (bool goes_on = true; goes_on;) {
    const auto item = reader.next(std::min(end, rt::now() + kLookInterval));
    if (!item && item.error() == rpc::CallError::kTimeout) {
      if (rt::now() >= end) break;  // The requested time is over.
      if (!reader.is_open()) return call_failed("the stream ended", item.error());
      goes_on = print({});
      continue;
    }
    if (!item) return call_failed("the stream ended", item.error());
    if (!*item) break;
    if (auto printed = print_payload(method.reply, **item, goes_on, print); !printed)
      return printed;
  }
  reader.cancel();
  return {};
}

expected<void, SetupError> RemoteObject::print_payload(const schema::Payload& payload,
                                                       ConstBytes bytes, bool& goes_on,
                                                       const Print& print) {
  const auto text = dynamic_->decode(payload, bytes);
  if (!text) return setup_error("the reply does not fit the schema");
  goes_on = print(*text);
  return {};
}

}  // namespace rtpm::dynamic
