#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "rtpm/base/time.hpp"

namespace rtpm::rpc {

/// What generated code says of one method.
struct MethodDescriptor {
  std::uint16_t id = 0;           ///< `rtpm_id` in the schema, 1…65535.
  std::string_view name{};        ///< As in the schema.
  std::uint32_t fingerprint = 0;  ///< Of everything that both sides must agree on to call it.
  bool is_idempotent = false;     ///< `rtpm_idempotent`: running it twice does no harm.
  Duration default_deadline{0};   ///< `rtpm_deadline_us`; 0: the node's default.
};

/// What generated code says of one rpc_service. Every instance is a constant of static life.
struct InterfaceDescriptor {
  std::string_view name{};              ///< Fully qualified, "lab.Arm".
  std::uint64_t fingerprint = 0;        ///< Of all methods together.
  std::string_view compiler_version{};  ///< Of the rtpmc that wrote this.
  std::span<const MethodDescriptor> methods{};
};

/// A request or reply without content, `rtpm.Empty` in a schema: no bytes on the wire.
struct Empty {};

}  // namespace rtpm::rpc
