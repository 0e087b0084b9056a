#pragma once

#include <functional>
#include <introspection.rtpm.hpp>
#include <map>
#include <string>
#include <string_view>

namespace rtpm::introspection {

/// Where a server's catalog is served, so that tools find it.
inline constexpr std::string_view kPath = "rtpm/introspection";

/// The objects of one server with their interfaces, as an object of that server:
///
///     Catalog catalog;
///     catalog.add("lab/arm0", arm);
///     server->add(kPath, catalog);
/// @ownership keeps the descriptors of interfaces, which are constants, and no servant
/// @threads  add before the server's start(); then calls from any lane
/// @realtime none of its methods; it runs at the lowest priority whatever the caller's is
class Catalog final : public IntrospectionServant {
 public:
  /// Tells of `servant` under `path`; the same path again replaces it.
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
