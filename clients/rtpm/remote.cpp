#include "remote.hpp"

#include <chrono>
#include <utility>

#include "rtpm/introspection/catalog.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

rpc::SetupError at(const std::string& url, rpc::CallError error, const std::string& what) {
  return {what + " of " + url + ": " + std::string(to_string(error))};
}

}  // namespace

expected<std::string, rpc::SetupError> url_of(const std::string& target, rpc::Resolver& resolver) {
  if (wire::is_url(target)) return target;
  return resolver.resolve(target);
}

std::string catalog_url(const std::string& url) {
  const auto parts = wire::parse_url(url);
  if (!parts) return {};
  return "rtpm://" + parts->host + ':' + std::to_string(parts->port) + '/' +
         std::string(introspection::kPath);
}

expected<std::unique_ptr<RemoteObject>, rpc::SetupError> RemoteObject::open(
    rpc::Node& node, const std::string& url) {
  const auto parts = wire::parse_url(url);
  if (!parts) return rpc::setup_error('"' + url + "\" is no URL rtpm://host:port/path");
  auto catalog = introspection::IntrospectionClient::bind(node, catalog_url(url));
  if (!catalog) {
    return rpc::setup_error("the server tells nothing of its objects: " + catalog.error().text +
                            "; serve an rtpm::introspection::Catalog there");
  }
  introspection::DescribeRequestT request;
  request.path = parts->path;
  const auto description = catalog->describe(request);
  if (!description) return unexpected{at(url, description.error(), "the description")};

  auto object = std::unique_ptr<RemoteObject>(new RemoteObject);
  object->schema_ = (*description)->schema()->str();
  object->compiler_version_ = (*description)->compiler_version()->str();
  std::string error;
  object->dynamic_ =
      schema::Dynamic::make(object->schema_, (*description)->interface()->string_view(), error);
  if (!object->dynamic_) {
    return rpc::setup_error("the schema of " + url + ", by rtpmc " + object->compiler_version_ +
                            ", cannot be read: " + error);
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

expected<std::string, rpc::SetupError> RemoteObject::call(std::string_view method,
                                                          std::string_view json,
                                                          const rpc::CallOptions& options) {
  const schema::Method* found = dynamic_->find(method);
  if (found == nullptr) {
    std::string names;
    for (const schema::Method& candidate : dynamic_->service().methods) {
      names += (names.empty() ? "" : ", ") + candidate.name;
    }
    return rpc::setup_error(dynamic_->service().name + " has no method `" + std::string(method) +
                            "`; it has " + names);
  }
  if (found->oneway || found->is_stream) {
    return rpc::setup_error("`" + found->name + "` is " + (found->oneway ? "oneway" : "a stream") +
                            ", which this tool cannot call");
  }
  std::string error;
  const auto request = dynamic_->encode(found->request, json, error);
  if (!request) return rpc::setup_error("the request does not fit the schema: " + error);
  const auto index = static_cast<std::size_t>(found - dynamic_->service().methods.data());
  const auto reply = binding_->call(methods_[index], *request, options);
  if (!reply) return rpc::setup_error(std::string(to_string(reply.error())));
  auto text = dynamic_->decode(found->reply, reply->bytes());
  if (!text) return rpc::setup_error("the reply does not fit the schema");
  return *std::move(text);
}

}  // namespace rtpm::tool
