#include "rtpm/introspection/catalog.hpp"

#include <utility>
#include <vector>

#include "rtpm/rpc/caller.hpp"
#include "tap_server.hpp"

namespace rtpm::introspection {

Catalog::Catalog() = default;
Catalog::~Catalog() = default;

expected<void, SetupError> Catalog::serve(rpc::Server& server) {
  const rpc::ObjectOptions by_path{interface().priority_model, interface().priority, {}, true};
  if (auto added = server.add(kPath, *this, by_path); !added) return added;
  tap_ = std::make_unique<TapServer>(server.tap());
  if (auto added = server.add(kTapPath, *tap_); !added) return added;
  return tap_->start();
}

namespace {

bool may_see(const rpc::Caller* caller, std::string_view path) noexcept {
  return caller == nullptr || caller->role_on(path) >= Role::kObserve;
}

}  // namespace

void Catalog::add(std::string path, const rpc::Servant& servant) {
  objects_.insert_or_assign(std::move(path), &servant.interface());
}

rpc::Result<void> Catalog::list(rpc::ReplyBuilder<ListReply>& reply,
                                const rpc::CallContext& context) {
  auto& builder = reply.builder();
  std::vector<flatbuffers::Offset<ObjectEntry>> entries;
  entries.reserve(objects_.size());
  for (const auto& [path, interface] : objects_) {
    if (!may_see(context.identity, path)) continue;
    const auto path_at = builder.CreateString(path);
    entries.push_back(CreateObjectEntry(
        builder, path_at, builder.CreateString(interface->name.data(), interface->name.size())));
  }
  reply.finish(CreateListReply(builder, builder.CreateVector(entries)));
  return {};
}

rpc::Result<void> Catalog::describe(const DescribeRequest& request,
                                    rpc::ReplyBuilder<Description>& reply,
                                    const rpc::CallContext& context) {
  if ((request.path() == nullptr) == (request.interface() == nullptr)) {
    return unexpected{rpc::Refusal::kBadRequest};
  }
  const rpc::InterfaceDescriptor* found = find(request, context.identity);
  if (found == nullptr) return unexpected{rpc::Refusal::kGone};
  auto& builder = reply.builder();
  const auto text = [&](std::string_view view) {
    return builder.CreateString(view.data(), view.size());
  };
  const auto name = text(found->name);
  const auto version = text(found->compiler_version);
  const auto schema = text(found->schema);
  reply.finish(CreateDescription(builder, name, found->fingerprint, version, schema));
  return {};
}

// An object that the caller may not see does not exist for the caller.
const rpc::InterfaceDescriptor* Catalog::find(const DescribeRequest& request,
                                              const rpc::Caller* caller) const {
  if (request.path() != nullptr) {
    if (!may_see(caller, request.path()->string_view())) return nullptr;
    const auto found = objects_.find(request.path()->string_view());
    return found == objects_.end() ? nullptr : found->second;
  }
  for (const auto& [path, interface] : objects_) {
    const bool is_wanted = interface->name == request.interface()->string_view();
    if (is_wanted && may_see(caller, path)) return interface;
  }
  return nullptr;
}

}  // namespace rtpm::introspection
