#include "rtpm/names/resolver.hpp"

#include <utility>

namespace rtpm::names {

RegistryResolver::RegistryResolver(rpc::Node& node, std::string registry_url)
    : node_(node), directory_(node, std::move(registry_url)) {}

RegistryResolver::~RegistryResolver() {
  node_.forget(*this);
}

expected<std::string, SetupError> RegistryResolver::resolve(std::string_view name,
                                                            MonotonicTime deadline) {
  auto url = directory_.url_of(name, deadline);
  if (!url) return unexpected{std::move(url.error())};
  return std::move(*url);
}

}  // namespace rtpm::names
