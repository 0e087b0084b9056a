#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "model/record.hpp"
#include "names.rtpm.hpp"
#include "rtpm/names/directory.hpp"

/// Converts between the library's types and the generated ones.
namespace rtpm::names {

/// Nanoseconds from outside, clamped to the range of Duration.
[[nodiscard]] inline Duration duration_of(std::uint64_t ns) noexcept {
  constexpr auto kMax = static_cast<std::uint64_t>(Duration::max().count());
  return Duration{static_cast<Duration::rep>(std::min(ns, kMax))};
}

/// A negative time becomes 0 on the wire, which the registry refuses as a lease.
[[nodiscard]] inline std::uint64_t ns_of(Duration duration) noexcept {
  return static_cast<std::uint64_t>(std::max(duration, Duration{0}).count());
}

[[nodiscard]] inline OwnerId id_of(Owner owner) noexcept {
  return {owner.id, owner.epoch};
}
[[nodiscard]] inline Owner owner_of(const OwnerId& id) noexcept {
  return {id.id(), id.epoch()};
}

[[nodiscard]] inline Outcome outcome_of(const Answer& answer) noexcept {
  return static_cast<Outcome>(answer.outcome());
}
[[nodiscard]] inline Answer answer_of(Outcome outcome, std::uint8_t component = 0) noexcept {
  return {static_cast<OutcomeCode>(outcome), component};
}

using PropertyTables = flatbuffers::Vector<flatbuffers::Offset<PropertyEntry>>;

/// nullopt if a property has an unknown type.
[[nodiscard]] std::optional<std::vector<Property>> properties_of(const PropertyTables* tables);
/// Null if there are no properties.
[[nodiscard]] flatbuffers::Offset<PropertyTables> write_properties(
    flatbuffers::FlatBufferBuilder& builder, std::span<const Property> properties);

[[nodiscard]] inline std::string_view view_of(const flatbuffers::String* text) noexcept {
  return text == nullptr ? std::string_view{} : text->string_view();
}
[[nodiscard]] inline std::string text_of(const flatbuffers::String* text) {
  return std::string(view_of(text));
}

[[nodiscard]] NameEntry entry_of(const Entry& entry, std::uint64_t stale_ns = 0);

// Both enumerations must use the same wire numbers.
static_assert(static_cast<Outcome>(OutcomeCode::MAX) == Outcome::kStoreUnreachable);

}  // namespace rtpm::names
