#pragma once

#include <functional>
#include <introspection.rtpm.hpp>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "rtpm/rpc/server.hpp"

namespace rtpm::introspection {

/// The catalog's path in every server.
inline constexpr std::string_view kPath = "rtpm/introspection";
/// The path of a server's call tap.
inline constexpr std::string_view kTapPath = "rtpm/tap";

class TapServer;

/// The objects of a server with their interfaces, served as an object of that server:
///
///     Catalog catalog;
///     catalog.add("lab/arm0", arm);
///     catalog.serve(*server);
/// @ownership must outlive the server's stop(); refers to the constant interface descriptors, not
/// to the servants
/// @threads  add() before the server's start(), calls from any lane
/// @realtime none; runs at the lowest priority
class Catalog final : public IntrospectionServant {
 public:
  Catalog();
  ~Catalog() override;

  /// Adds `servant` under `path`, or replaces it.
  /// @realtime set-up only
  void add(std::string path, const rpc::Servant& servant);
  /// Adds this catalog and the server's call tap to a server, under kPath and kTapPath. The tap's
  /// thread sleeps unless a client records calls.
  /// @realtime set-up only, once
  /// @errors   a path in use; no thread left
  [[nodiscard]] expected<void, SetupError> serve(rpc::Server& server);

  rpc::Result<void> list(rpc::ReplyBuilder<ListReply>& reply,
                         const rpc::CallContext& context) override;
  rpc::Result<void> describe(const DescribeRequest& request, rpc::ReplyBuilder<Description>& reply,
                             const rpc::CallContext& context) override;

 private:
  [[nodiscard]] const rpc::InterfaceDescriptor* find(const DescribeRequest& request,
                                                     const rpc::Caller* caller) const;

  std::map<std::string, const rpc::InterfaceDescriptor*, std::less<>> objects_{};
  std::unique_ptr<TapServer> tap_{};
};

}  // namespace rtpm::introspection
