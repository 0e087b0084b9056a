#include "rtpm/events/hub_types.hpp"

#include <utility>

#include "filter/catalog.hpp"
#include "idl.hpp"

namespace rtpm::events {

class HubTypes::Impl {
 public:
  TypeCatalog catalog{};
};

HubTypes::HubTypes(std::unique_ptr<Impl> impl)
    : impl_(std::move(impl)), list_(impl_->catalog.list()) {}
HubTypes::HubTypes(HubTypes&&) noexcept = default;
HubTypes& HubTypes::operator=(HubTypes&&) noexcept = default;
HubTypes::~HubTypes() = default;

expected<HubTypes, SetupError> HubTypes::ask(rpc::Node& node, const std::string& target,
                                             Duration deadline) {
  auto hub = HubClient::bind(node, target, {.deadline = deadline});
  if (!hub) return unexpected{std::move(hub.error())};
  const auto reply = hub->types({}, {.deadline = deadline});
  if (!reply) {
    return setup_error("the types of the hub at " + target + " are not known",
                       rpc::make_error_code(reply.error()));
  }
  auto impl = std::make_unique<Impl>();
  for (const TypeEntry* entry : *(*reply)->types()) {
    if (auto added = impl->catalog.add(descriptor_of(*entry).descriptor); !added) {
      return setup_error("a type of the hub at " + target, std::move(added.error()));
    }
  }
  return HubTypes(std::move(impl));
}

const EventDescriptor* HubTypes::find(EventType type) const noexcept {
  return impl_->catalog.find(type);
}

}  // namespace rtpm::events
