#pragma once

#include <string>
#include <string_view>

#include "rtpm/names/directory.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::names {

/// Lets a node bind objects by name: `node.use(resolver)`.
/// @ownership refers to its node, which must outlive it. At its end the node forgets it: bindings
///            by name stay with the servers that they have
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
  /// @errors   "no registry answers at …"; a name that is not bound, with the component that is
  ///           missing
  [[nodiscard]] expected<std::string, rpc::SetupError> resolve(std::string_view name,
                                                               MonotonicTime deadline) override;

 private:
  rpc::Node& node_;
  Directory directory_;
};

}  // namespace rtpm::names
