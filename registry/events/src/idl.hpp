#pragma once

#include <events.rtpm.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/events/delivery.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/events/scalar.hpp"

/// Between the library's words and those of its IDL.
namespace rtpm::events {

/// The filter of an untrusted request; nothing if it has more nodes than any may have, or a kind
/// that there is not: a table may stand in many places at once, so that a few bytes are a huge
/// tree.
[[nodiscard]] std::optional<Filter> filter_of(const FilterNode& node);
[[nodiscard]] std::unique_ptr<FilterNodeT> entry_of(const Filter& filter);

[[nodiscard]] std::optional<DeliveryPolicy> policy_of(const DeliveryEntry& entry);
[[nodiscard]] std::unique_ptr<DeliveryEntryT> entry_of(const DeliveryPolicy& policy);

/// A description that came in a request, and what it refers to.
struct OwnedDescriptor {
  std::vector<FieldDescriptor> fields{};
  EventDescriptor descriptor{};
};
/// Views the request's texts.
[[nodiscard]] OwnedDescriptor descriptor_of(const TypeEntry& entry);
[[nodiscard]] std::unique_ptr<TypeEntryT> entry_of(const EventDescriptor& descriptor);

/// Why a hub refused, in its words, for people.
[[nodiscard]] std::string refusal_of(const flatbuffers::String& text);

[[nodiscard]] inline LossCounts counts_of(const Losses& losses) {
  return {losses.overflow_count, losses.replaced_count, losses.suspended_count, losses.memory_count,
          losses.too_large_count};
}
[[nodiscard]] inline Losses losses_of(const LossCounts& counts) {
  return {counts.overflow(),
          counts.replaced(),
          counts.suspended(),
          counts.memory(),
          counts.too_large(),
          0,
          0};
}

}  // namespace rtpm::events
