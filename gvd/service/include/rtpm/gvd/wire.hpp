#pragma once

#include <device.rtpm.hpp>

#include "rtpm/base/priority.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/client_command.hpp"
#include "rtpm/gvd/error.hpp"
#include "rtpm/gvd/lease.hpp"

/// Converts between driver types and schema types.
namespace rtpm::gvd {

[[nodiscard]] device::Vector3 to_wire(const driver::Vector3& vector) noexcept;
[[nodiscard]] driver::Vector3 from_wire(const device::Vector3& vector) noexcept;

/// @realtime alloc-free
[[nodiscard]] device::Sample to_wire(const driver::Sample& sample) noexcept;
/// An unknown lifecycle reads as kFault.
/// @realtime alloc-free
[[nodiscard]] driver::Sample from_wire(const device::Sample& wire) noexcept;

/// A mode of a later version reads as one that no device accepts.
/// @realtime alloc-free
[[nodiscard]] ClientCommand from_wire(const device::Command& wire) noexcept;
/// @realtime alloc-free
[[nodiscard]] device::Command to_wire(const ClientCommand& command) noexcept;

/// @realtime alloc-free
[[nodiscard]] device::Outcome to_wire(DeviceOutcome outcome) noexcept;
/// The reply to a client that got the lease `id`.
/// @realtime alloc-free
[[nodiscard]] device::Lease granted_to_wire(std::uint64_t id, const LeaseConfig& config) noexcept;
/// The reply to a client that did not get the lease.
/// @realtime alloc-free
[[nodiscard]] device::Lease refused_to_wire(DeviceOutcome outcome) noexcept;

/// The settings that a device's server adds to its descriptor.
struct ServerTerms {
  Duration period{};
  Duration hold_max{};
  Duration ramp{};
  Priority operator_priority{};
};

/// @realtime allocates only in `builder`
[[nodiscard]] flatbuffers::Offset<device::Description> to_wire(
    const driver::Descriptor& descriptor, const ServerTerms& terms,
    flatbuffers::FlatBufferBuilder& builder);
/// @realtime set-up only
[[nodiscard]] driver::Descriptor from_wire(const device::Description& wire);

}  // namespace rtpm::gvd
