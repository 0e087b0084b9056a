#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/role.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::rpc {

/// Which side decides the priority at which an object's methods run.
enum class PriorityModel : std::uint8_t {
  /// The caller's priority, sent with the call; `priority` if the call has none.
  kClientPropagated,
  kServerDeclared,  ///< The object's `priority`, regardless of the caller's.
  kNone,            ///< The lane's priority. Only for servers with one lane.
};

/// Maps the priority that a call carries to the one at which its method runs
/// (ServerConfig::inbound_priority) or at which the call goes out (NodeConfig::outbound_priority).
/// `path` is the object's. Runs for each call on the thread that serves or makes it, so it must not
/// allocate, lock or throw.
/// @source   RT-CORBA's priority transforms
using PriorityTransform = Priority (*)(Priority priority, std::string_view path);

/// One method, as generated code describes it.
struct MethodDescriptor {
  std::uint16_t id = 0;           ///< `rtpm_id` in the schema, 1…65535.
  std::string_view name{};        ///< The method's name in the schema.
  std::uint32_t fingerprint = 0;  ///< Covers everything that both sides must agree on to call it.
  bool is_idempotent = false;     ///< `rtpm_idempotent`: running it twice does no harm.
  Duration default_deadline{0};   ///< `rtpm_deadline_us`; 0 for the node's default.
  Role role = Role::kCommand;     ///< `rtpm_role`: the role that a caller needs.
};

/// One rpc_service, as generated code describes it. Every instance is a constant with static
/// lifetime.
struct InterfaceDescriptor {
  std::string_view name{};              ///< Fully qualified, "lab.Arm".
  std::uint64_t fingerprint = 0;        ///< Covers all methods together.
  std::string_view compiler_version{};  ///< The version of the rtpmc that wrote this.
  std::span<const MethodDescriptor> methods{};
  PriorityModel priority_model = PriorityModel::kClientPropagated;  ///< `rtpm_priority_model`.
  Priority priority = 0;                                            ///< `rtpm_priority`.
  /// The service's complete schema, for tools that lack its generated code.
  std::string_view schema{};
  /// Everything that both sides must agree on, as text that allows two versions to be compared. If
  /// empty, only equal fingerprints match.
  /// @source   spec/hprotocol.md#hp-12.2
  std::string_view text{};
};

/// A request or reply without content, `rtpm.Empty` in a schema: no bytes on the wire.
struct Empty {};

}  // namespace rtpm::rpc
