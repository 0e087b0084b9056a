#include "rtpm/names/resolver.hpp"

#include <utility>

namespace rtpm::names {

RegistryResolver::RegistryResolver(rpc::Node& node, std::string registry_url)
    : directory_(node, std::move(registry_url), node.config().default_deadline) {}

expected<std::string, rpc::SetupError> RegistryResolver::resolve(std::string_view name) {
  auto entry = directory_.resolve(name);
  if (!entry) return rpc::setup_error(std::move(entry.error().text));
  return std::move(entry->url);
}

}  // namespace rtpm::names
