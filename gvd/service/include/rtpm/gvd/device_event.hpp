#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "rtpm/driver/sample.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/gvd/lease.hpp"
#include "rtpm/models/model.hpp"

/// Events of devices: samples, and changes between samples.
namespace rtpm::gvd {

/// The types of device events.
/// @source   schema/idl/device_events.fbs
inline constexpr events::EventType kSampled = 1380974593;
inline constexpr events::EventType kButtonChanged = 1380974594;
inline constexpr events::EventType kContactChanged = 1380974595;
inline constexpr events::EventType kLifecycleChanged = 1380974596;
inline constexpr events::EventType kFaultChanged = 1380974597;
inline constexpr events::EventType kLeaseChanged = 1380974598;
inline constexpr events::EventType kStopChanged = 1380974599;
inline constexpr events::EventType kConfigurationChanged = 1380974600;
inline constexpr events::EventType kModelsRendered = 1380974604;

/// The source of a device's events: the 32-bit FNV-1a hash of its name, such as "lab/arm0".
[[nodiscard]] constexpr events::SourceId source_of(std::string_view device) noexcept {
  std::uint32_t hash = 0x811c9dc5;
  for (const char byte : device) {
    hash = (hash ^ static_cast<std::uint8_t>(byte)) * 0x01000193;
  }
  return hash;
}

/// The descriptor of a device event; null for any other type.
[[nodiscard]] const events::EventDescriptor* device_event_type(events::EventType type);

/// Samples of a device.
[[nodiscard]] events::Filter samples_of(std::string_view device);
/// All changes of a device, without its samples.
[[nodiscard]] events::Filter changes_of(std::string_view device);
/// Presses, or releases, of one of the device's buttons.
[[nodiscard]] events::Filter pressed(std::string_view device, std::size_t button);
[[nodiscard]] events::Filter released(std::string_view device, std::size_t button);

struct ButtonChange {
  std::size_t button = 0;  ///< Index in Descriptor::buttons.
  bool is_pressed = false;
  friend bool operator==(const ButtonChange&, const ButtonChange&) = default;
};
/// The device started or stopped pushing its user.
struct ContactChange {
  bool is_touching = false;
  double force_newton = 0;  ///< Magnitude.
  friend bool operator==(const ContactChange&, const ContactChange&) = default;
};
struct LifecycleChange {
  driver::Lifecycle before = driver::Lifecycle::kUnconfigured;
  driver::Lifecycle after = driver::Lifecycle::kUnconfigured;
  friend bool operator==(const LifecycleChange&, const LifecycleChange&) = default;
};
struct FaultChange {
  driver::Faults begun{};
  driver::Faults ended{};
  friend bool operator==(const FaultChange&, const FaultChange&) = default;
};
struct LeaseChange {
  /// kHeld while a client holds it; otherwise why it ended.
  LeaseState state = LeaseState::kUnknown;
  friend bool operator==(const LeaseChange&, const LeaseChange&) = default;
};
/// An emergency stop started or ended.
struct StopChange {
  bool is_stopped = false;
  friend bool operator==(const StopChange&, const StopChange&) = default;
};
struct ConfigurationChange {
  std::uint64_t revision = 0;
  std::vector<std::string> names{};  ///< The changed parameters.
  friend bool operator==(const ConfigurationChange&, const ConfigurationChange&) = default;
};
/// The local models that the device renders; see ModelsRendered in device_events.fbs.
struct ModelsChange {
  std::vector<Model> models{};  ///< Empty: they have ended.
  friend bool operator==(const ModelsChange&, const ModelsChange&) = default;
};
/// A timeout of the subscription's filter.
struct Timeout {
  std::uint32_t tag = 0;  ///< The tag of the filter.
  friend bool operator==(const Timeout&, const Timeout&) = default;
};

/// One event.
/// @ownership a value, except `device`
struct DeviceEvent {
  /// One of DeviceConsumerConfig::devices; empty for an event of another device, or a timeout.
  std::string_view device{};
  std::uint64_t cycle = 0;  ///< Sample::sequence of its cycle; 0 if it has none.
  /// The event's header, with origin and flags such as is_replayed.
  events::EventHeader header{};
  std::variant<Timeout, driver::Sample, ButtonChange, ContactChange, LifecycleChange, FaultChange,
               LeaseChange, StopChange, ConfigurationChange, ModelsChange>
      what{};
};

}  // namespace rtpm::gvd
