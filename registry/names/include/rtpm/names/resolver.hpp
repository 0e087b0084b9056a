#pragma once

#include <string>
#include <string_view>

#include "rtpm/names/directory.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// Resolves a node's names at the registry: `node.use(resolver)`.
/// @ownership refers to its node, which must outlive it; when destroyed it detaches, and bindings
///            stay with their servers
/// @threads  any, several at once
/// @realtime set-up only
class RegistryResolver final : public rpc::Resolver {
 public:
  explicit RegistryResolver(rpc::Node& node,
                            std::string registry_url = std::string(kDefaultRegistryUrl));

  RegistryResolver(const RegistryResolver&) = delete;
  RegistryResolver& operator=(const RegistryResolver&) = delete;
  ~RegistryResolver() override;

  /// Asks the registry.
  /// @errors   "no registry answers at …"; the name is not bound (the text names the missing
  ///           component)
  [[nodiscard]] expected<std::string, SetupError> resolve(std::string_view name,
                                                          MonotonicTime deadline) override;

 private:
  rpc::Node& node_;
  Directory directory_;
};

}  // namespace rtpm::names
