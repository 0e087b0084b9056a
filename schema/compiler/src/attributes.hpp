#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace rtpm::schema {

/// Where one of RTPM's attributes may stand, and what it takes.
struct KnownAttribute {
  std::string_view name{};
  std::string_view place{};  ///< In words, for errors: "a method of an rpc_service".
  std::uint32_t max = 0;     ///< Its value is a whole number from 1 to this; 0: it takes no value.
};

/// The attributes that schema/idl/rtpm.fbs declares.
inline constexpr std::array kKnownAttributes{
    KnownAttribute{"rtpm_id", "a method of an rpc_service", 65535},
    KnownAttribute{"rtpm_idempotent", "a method of an rpc_service", 0},
    // A quarter of an hour: nobody waits longer for one call.
    KnownAttribute{"rtpm_deadline_us", "a method of an rpc_service", 900'000'000},
};

/// The attribute with this name, nullptr if RTPM has none.
[[nodiscard]] const KnownAttribute* find_attribute(std::string_view name) noexcept;
[[nodiscard]] inline bool is_known_attribute(std::string_view name) noexcept {
  return find_attribute(name) != nullptr;
}
/// How the value of RTPM's attribute `name` is written; empty if there is no such attribute.
[[nodiscard]] std::string value_hint(std::string_view name);
/// Whether `name` is one of the attributes of FlatBuffers' own language.
[[nodiscard]] bool is_flatbuffers_attribute(std::string_view name) noexcept;
/// The hint for an attribute that nobody knows.
[[nodiscard]] std::string unknown_attribute_hint(std::string_view name);

}  // namespace rtpm::schema
