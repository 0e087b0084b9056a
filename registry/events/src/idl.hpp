#pragma once

#include <events.rtpm.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/events/delivery.hpp"
#include "rtpm/events/filter.hpp"
#include "rtpm/events/scalar.hpp"

/// Converts between the library's types and the IDL's.
namespace rtpm::events {

/// The filter in an untrusted request; nullopt if it has too many nodes or an unknown kind. Shared
/// tables allow a few bytes to encode a huge tree.
[[nodiscard]] std::optional<Filter> filter_of(const FilterNode& node);
[[nodiscard]] std::unique_ptr<FilterNodeT> entry_of(const Filter& filter);

[[nodiscard]] std::optional<DeliveryPolicy> policy_of(const DeliveryEntry& entry);
[[nodiscard]] std::unique_ptr<DeliveryEntryT> entry_of(const DeliveryPolicy& policy);

/// A descriptor from a request, with the data that it refers to.
struct OwnedDescriptor {
  std::vector<FieldDescriptor> fields{};
  EventDescriptor descriptor{};
};
/// The result refers to the request's texts.
[[nodiscard]] OwnedDescriptor descriptor_of(const TypeEntry& entry);
[[nodiscard]] std::unique_ptr<TypeEntryT> entry_of(const EventDescriptor& descriptor);

/// The text of a hub's refusal, escaped.
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

/// Without those that a newer event replaced, or that arrived during a suspension: both as asked for.
[[nodiscard]] inline std::uint64_t involuntary(const Losses& losses) {
  return losses.total() - losses.replaced_count - losses.suspended_count;
}

}  // namespace rtpm::events
