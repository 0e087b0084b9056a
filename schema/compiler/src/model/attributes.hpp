#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace rtpm::schema {

enum class AttributePlace : std::uint8_t { kMethod, kService, kTable, kField };

enum class AttributeValue : std::uint8_t {
  kNone,
  kNumber,  ///< A whole number from min to max.
  kChoice,  ///< One of `choices`.
  kText,    ///< See is_plain_text().
  kRange,   ///< "low..high".
};

struct KnownAttribute {
  std::string_view name{};
  AttributePlace place{};
  AttributeValue value{};
  std::uint32_t min = 0;
  std::uint32_t max = 0;
  std::array<std::string_view, 4> choices{};  ///< Unused ones are empty.
};

/// The attributes that schema/idl/rtpm.fbs declares.
inline constexpr std::array kKnownAttributes{
    KnownAttribute{"rtpm_id", AttributePlace::kMethod, AttributeValue::kNumber, 1, 65535},
    KnownAttribute{"rtpm_idempotent", AttributePlace::kMethod, AttributeValue::kNone},
    // A quarter of an hour.
    KnownAttribute{"rtpm_deadline_us", AttributePlace::kMethod, AttributeValue::kNumber, 1,
                   900'000'000},
    KnownAttribute{"rtpm_oneway",
                   AttributePlace::kMethod,
                   AttributeValue::kChoice,
                   0,
                   0,
                   {"sent", "received", "done"}},
    KnownAttribute{"rtpm_role",
                   AttributePlace::kMethod,
                   AttributeValue::kChoice,
                   0,
                   0,
                   {"observe", "command", "configure", "administer"}},
    KnownAttribute{"rtpm_deferred", AttributePlace::kMethod, AttributeValue::kNone},
    KnownAttribute{"rtpm_stream", AttributePlace::kMethod, AttributeValue::kNone},
    // The protocol's own limit for a message.
    KnownAttribute{"rtpm_max_size", AttributePlace::kMethod, AttributeValue::kNumber, 16,
                   16 * 1024 * 1024},
    KnownAttribute{"rtpm_priority", AttributePlace::kService, AttributeValue::kNumber, 0, 32767},
    KnownAttribute{"rtpm_priority_model",
                   AttributePlace::kService,
                   AttributeValue::kChoice,
                   0,
                   0,
                   {"client_propagated", "server_declared"}},
    // The largest number that FlatBuffers accepts in an attribute.
    KnownAttribute{"rtpm_event", AttributePlace::kTable, AttributeValue::kNumber, 1, 2147483647},
    KnownAttribute{"rtpm_unit", AttributePlace::kField, AttributeValue::kText},
    KnownAttribute{"rtpm_range", AttributePlace::kField, AttributeValue::kRange},
    KnownAttribute{"rtpm_frame", AttributePlace::kField, AttributeValue::kText},
};

/// RTPM's attribute `name`; nullptr if there is none.
[[nodiscard]] const KnownAttribute* find_attribute(std::string_view name) noexcept;
[[nodiscard]] inline bool is_known_attribute(std::string_view name) noexcept {
  return find_attribute(name) != nullptr;
}
/// The kind of declaration in words, for errors: "a method of an rpc_service".
[[nodiscard]] std::string_view words_of(AttributePlace place) noexcept;
/// How to write the value of RTPM's attribute `name`; empty if there is no such attribute.
[[nodiscard]] std::string value_hint(std::string_view name);
/// Whether an attribute may have this text: 1 to 64 bytes without control characters, quotation
/// marks or backslashes, so that comments and JSON need no escapes.
[[nodiscard]] bool is_plain_text(std::string_view value) noexcept;
[[nodiscard]] bool is_flatbuffers_attribute(std::string_view name) noexcept;
/// The hint for an unknown attribute.
[[nodiscard]] std::string unknown_attribute_hint(std::string_view name);

}  // namespace rtpm::schema
