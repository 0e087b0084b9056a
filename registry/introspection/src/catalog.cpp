#include "rtpm/introspection/catalog.hpp"

#include <utility>
#include <vector>

#include "tap_server.hpp"

namespace rtpm::introspection {

Catalog::Catalog() = default;
Catalog::~Catalog() = default;

expected<void, SetupError> Catalog::serve(rpc::Server& server) {
  if (auto added = server.add(kPath, *this); !added) return added;
  tap_ = std::make_unique<TapServer>(server.tap());
  if (auto added = server.add(kTapPath, *tap_); !added) return added;
  return tap_->start();
}

void Catalog::add(std::string path, const rpc::Servant& servant) {
  objects_.insert_or_assign(std::move(path), &servant.interface());
}

rpc::Result<void> Catalog::list(rpc::ReplyBuilder<ListReply>& reply, const rpc::CallContext&) {
  auto& builder = reply.builder();
  std::vector<flatbuffers::Offset<ObjectEntry>> entries;
  entries.reserve(objects_.size());
  for (const auto& [path, interface] : objects_) {
    const auto path_at = builder.CreateString(path);
    entries.push_back(CreateObjectEntry(
        builder, path_at, builder.CreateString(interface->name.data(), interface->name.size())));
  }
  reply.finish(CreateListReply(builder, builder.CreateVector(entries)));
  return {};
}

rpc::Result<void> Catalog::describe(const DescribeRequest& request,
                                    rpc::ReplyBuilder<Description>& reply,
                                    const rpc::CallContext&) {
  if ((request.path() == nullptr) == (request.interface() == nullptr)) {
    return unexpected{rpc::Refusal::kBadRequest};
  }
  const rpc::InterfaceDescriptor* found = find(request);
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

const rpc::InterfaceDescriptor* Catalog::find(const DescribeRequest& request) const {
  if (request.path() != nullptr) {
    const auto found = objects_.find(request.path()->string_view());
    return found == objects_.end() ? nullptr : found->second;
  }
  for (const auto& [path, interface] : objects_) {
    if (interface->name == request.interface()->string_view()) return interface;
  }
  return nullptr;
}

}  // namespace rtpm::introspection
