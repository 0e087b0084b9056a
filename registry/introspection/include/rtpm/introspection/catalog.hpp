#pragma once

#include <functional>
#include <introspection.rtpm.hpp>
#include <map>
#include <string>
#include <string_view>

namespace rtpm::introspection {

/// Path of the catalog in every server.
inline constexpr std::string_view kPath = "rtpm/introspection";

/// The objects of a server with their interfaces, as an object of that server:
///
///     Catalog catalog;
///     catalog.add("lab/arm0", arm);
///     server->add(kPath, catalog);
/// @ownership refers to the constant interface descriptors, not to the servants
/// @threads  add() before the server's start(), calls from any lane
/// @realtime none; runs at the lowest priority
class Catalog final : public IntrospectionServant {
 public:
  /// Adds `servant` under `path`, or replaces it.
  /// @realtime set-up only
  void add(std::string path, const rpc::Servant& servant);

  rpc::Result<void> list(rpc::ReplyBuilder<ListReply>& reply,
                         const rpc::CallContext& context) override;
  rpc::Result<void> describe(const DescribeRequest& request, rpc::ReplyBuilder<Description>& reply,
                             const rpc::CallContext& context) override;

 private:
  [[nodiscard]] const rpc::InterfaceDescriptor* find(const DescribeRequest& request) const;

  std::map<std::string, const rpc::InterfaceDescriptor*, std::less<>> objects_{};
};

}  // namespace rtpm::introspection
