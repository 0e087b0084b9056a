#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace rtpm::schema {

/// Where one of RTPM's attributes may stand, and what it takes.
struct KnownAttribute {
  std::string_view name{};
  std::string_view place{};    ///< In words, for errors: "a method of an rpc_service".
  std::string_view example{};  ///< As one writes it.
};

/// The attributes that schema/idl/rtpm.fbs declares.
inline constexpr std::array kKnownAttributes{
    KnownAttribute{"rtpm_id", "a method of an rpc_service", "rtpm_id: 1"},
    KnownAttribute{"rtpm_idempotent", "a method of an rpc_service", "rtpm_idempotent"},
    KnownAttribute{"rtpm_deadline_us", "a method of an rpc_service", "rtpm_deadline_us: 800"},
};

[[nodiscard]] bool is_known_attribute(std::string_view name) noexcept;
/// Whether `name` is one of the attributes of FlatBuffers' own language.
[[nodiscard]] bool is_flatbuffers_attribute(std::string_view name) noexcept;
/// The attribute, RTPM's or FlatBuffers', that somebody who wrote `name` most likely meant, or "".
[[nodiscard]] std::string_view similar_attribute(std::string_view name);
/// The hint for an attribute that nobody knows.
[[nodiscard]] std::string unknown_attribute_hint(std::string_view name);

}  // namespace rtpm::schema
