#pragma once

#include <string>
#include <string_view>

#include "rtpm/events/event.hpp"
#include "rtpm/recording/mcap.hpp"

/// The names of a recording's channels and of their metadata, for readers.
namespace rtpm::capture {

/// The topic of annotations: JSON objects with `text`.
inline constexpr const char* kAnnotationTopic = "annotations";

/// Keys of a channel's metadata.
inline constexpr const char* kKindKey = "rtpm.kind";
inline constexpr const char* kTypeKey = "rtpm.type";           ///< The event's number.
inline constexpr const char* kNameKey = "rtpm.name";           ///< The event's name.
inline constexpr const char* kSourceKey = "rtpm.source";       ///< The event's source.
inline constexpr const char* kSchemaIdKey = "rtpm.schema_id";  ///< The schema's fingerprint.
inline constexpr const char* kPriorityKey = "rtpm.priority";
inline constexpr const char* kDeviceKey = "rtpm.device";  ///< The device's name, "lab/arm0".
/// Size in bytes of a payload that was a bare struct; the recorded table contains it as its only
/// field.
inline constexpr const char* kStructSizeKey = "rtpm.struct_size";
/// How far the log times of a medium may be off.
inline constexpr const char* kUncertaintyKey = "rtpm.uncertainty_ns";

/// Values of kKindKey.
inline constexpr const char* kEventKind = "event";
inline constexpr const char* kSampleKind = "sample";            ///< Polled; a Sampled.
inline constexpr const char* kDescriptionKind = "description";  ///< A device's Description.
inline constexpr const char* kCommandKind = "command";          ///< A CommandRequest.
inline constexpr const char* kParametersKind = "parameters";    ///< A configuration's ListReply.
inline constexpr const char* kViewKind = "view";                ///< For viewers, made from samples.
inline constexpr const char* kMediumKind = "medium";            ///< Pictures or sound.

/// The value of `key` in the channel's metadata; empty if there is none.
[[nodiscard]] std::string value_of(const recording::Channel& channel, const char* key);

/// Whether events of this type come from the device itself, so that their source is the device.
[[nodiscard]] bool is_device_event(events::EventType type) noexcept;

/// "lab/arm0/button_changed", from "lab/arm0" and "rtpm.device.ButtonChanged".
[[nodiscard]] std::string device_topic(std::string_view device, std::string_view type);

}  // namespace rtpm::capture
