#pragma once

#include <string>
#include <string_view>

#include "rtpm/names/directory.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// Lets a node bind objects by name: `node.use(resolver)`.
/// Ownership: refers to its node; both live for as long as the node binds.
/// Threads: any, several at once.   Set-up only.
class RegistryResolver final : public rpc::Resolver {
 public:
  explicit RegistryResolver(rpc::Node& node,
                            std::string registry_url = std::string(kDefaultRegistryUrl));

  /// Asks the registry, and waits for it as long as the node's calls do by default.
  /// Errors: "no registry answers at …"; a name that is not bound, with the component that is
  /// missing.
  [[nodiscard]] expected<std::string, rpc::SetupError> resolve(std::string_view name) override;

 private:
  Directory directory_;
};

}  // namespace rtpm::names
