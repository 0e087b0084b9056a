#include "idl.hpp"

#include "rtpm/base/printable.hpp"

#include "filter/compiled_filter.hpp"

namespace rtpm::events {
namespace {

Scalar scalar_of(const Number* number) {
  if (number == nullptr) return {};
  switch (number->kind()) {
    case NumberKind::Unsigned:
      return Scalar::of(number->natural());
    case NumberKind::Real:
      return Scalar::of(number->real());
    default:
      return Scalar::of(number->integer());
  }
}

Number number_of(const Scalar& scalar) {
  return {scalar.integer, scalar.natural, scalar.real, static_cast<NumberKind>(scalar.kind)};
}

constexpr auto kLastKind = NodeKind::Listed;
constexpr auto kLastComparison = Comparison::kHasAnyBit;
constexpr auto kLastPolicy = QueuePolicy::kDisconnect;

std::optional<Filter> filter_of(const FilterNode& node, std::size_t& budget) {
  if (budget == 0 || node.kind() > kLastKind ||
      node.comparison() > static_cast<std::uint8_t>(kLastComparison)) {
    return std::nullopt;
  }
  --budget;
  Filter filter;
  filter.kind = static_cast<Filter::Kind>(node.kind());
  filter.type = node.type();
  filter.type_mask = node.type_mask();
  filter.source = node.source();
  filter.source_mask = node.source_mask();
  if (node.field() != nullptr) filter.field = node.field()->str();
  filter.comparison = static_cast<Comparison>(node.comparison());
  filter.operand = scalar_of(node.operand());
  filter.span = Duration{node.span_ns()};
  filter.tag = node.tag();
  if (node.matches() != nullptr) {
    if (node.matches()->size() > kMatchCountMax) return std::nullopt;
    for (const MatchEntry* each : *node.matches()) {
      filter.matches.push_back(
          {each->type(), each->type_mask(), each->source(), each->source_mask(), each->hops_min()});
    }
  }
  if (node.children() == nullptr) return filter;
  for (const FilterNode* child : *node.children()) {
    auto made = filter_of(*child, budget);
    if (!made) return std::nullopt;
    filter.children.push_back(std::move(*made));
  }
  return filter;
}

}  // namespace

std::optional<Filter> filter_of(const FilterNode& node) {
  // One more than allowed, so that the compiler reports the error.
  std::size_t budget = kFilterNodeCountMax + 1;
  return filter_of(node, budget);
}

std::unique_ptr<FilterNodeT> entry_of(const Filter& filter) {
  auto node = std::make_unique<FilterNodeT>();
  node->kind = static_cast<NodeKind>(filter.kind);
  node->type = filter.type;
  node->type_mask = filter.type_mask;
  node->source = filter.source;
  node->source_mask = filter.source_mask;
  node->field = filter.field;
  node->comparison = static_cast<std::uint8_t>(filter.comparison);
  node->operand = std::make_unique<Number>(number_of(filter.operand));
  node->span_ns = filter.span.count();
  node->tag = filter.tag;
  for (const Match& each : filter.matches) {
    node->matches.emplace_back(each.type, each.type_mask, each.source, each.source_mask,
                               each.hops_min);
  }
  for (const Filter& child : filter.children)
    node->children.push_back(entry_of(child));
  return node;
}

std::optional<DeliveryPolicy> policy_of(const DeliveryEntry& entry) {
  if (entry.when_full() > static_cast<std::uint8_t>(kLastPolicy)) return std::nullopt;
  DeliveryPolicy policy;
  policy.every_nth = entry.every_nth();
  policy.interval = Duration{entry.interval_ns()};
  policy.is_trailing = entry.is_trailing();
  policy.when_full = static_cast<QueuePolicy>(entry.when_full());
  policy.queue_capacity = entry.queue_capacity();
  policy.replay = entry.replay();
  policy.is_interval_per_source = entry.is_interval_per_source();
  if (entry.deadbands() == nullptr) return policy;
  if (entry.deadbands()->size() > kDeadbandCountMax) return std::nullopt;
  for (const DeadbandEntry* each : *entry.deadbands()) {
    policy.deadbands.push_back({each->type(), each->field()->str(), each->threshold()});
  }
  return policy;
}

std::unique_ptr<DeliveryEntryT> entry_of(const DeliveryPolicy& policy) {
  auto entry = std::make_unique<DeliveryEntryT>();
  entry->every_nth = policy.every_nth;
  entry->interval_ns = policy.interval.count();
  entry->is_trailing = policy.is_trailing;
  entry->when_full = static_cast<std::uint8_t>(policy.when_full);
  entry->queue_capacity = policy.queue_capacity;
  entry->replay = policy.replay;
  entry->is_interval_per_source = policy.is_interval_per_source;
  for (const Deadband& each : policy.deadbands) {
    auto deadband = std::make_unique<DeadbandEntryT>();
    deadband->type = each.type;
    deadband->field = each.field;
    deadband->threshold = each.threshold;
    entry->deadbands.push_back(std::move(deadband));
  }
  return entry;
}

OwnedDescriptor descriptor_of(const TypeEntry& entry) {
  OwnedDescriptor owned;
  if (entry.fields() != nullptr) {
    for (const FieldEntry* each : *entry.fields()) {
      FieldDescriptor field{.name = each->name()->string_view(),
                            .type = static_cast<ScalarType>(each->type()),
                            .path = {.offset = each->offset()},
                            .default_value = scalar_of(each->default_value())};
      const auto* slots = each->slots();
      // Keeps one too many, which the catalog then refuses.
      const std::size_t count = slots == nullptr ? 0 : slots->size();
      field.path.slot_count =
          static_cast<std::uint8_t>(std::min<std::size_t>(count, FieldPath::kSlotCountMax + 1));
      for (std::size_t i = 0; i < std::min<std::size_t>(count, FieldPath::kSlotCountMax); ++i) {
        field.path.slots[i] = slots->Get(static_cast<flatbuffers::uoffset_t>(i));
      }
      owned.fields.push_back(field);
    }
  }
  owned.descriptor = {entry.type(), entry.name()->string_view(), entry.schema_id(), owned.fields,
                      entry.schema() == nullptr ? "" : entry.schema()->string_view()};
  return owned;
}

std::unique_ptr<TypeEntryT> entry_of(const EventDescriptor& descriptor) {
  auto entry = std::make_unique<TypeEntryT>();
  entry->type = descriptor.type;
  entry->name = descriptor.name;
  entry->schema_id = descriptor.schema_id;
  entry->schema = descriptor.schema;
  for (const FieldDescriptor& each : descriptor.fields) {
    auto field = std::make_unique<FieldEntryT>();
    field->name = each.name;
    field->type = static_cast<std::uint8_t>(each.type);
    field->slots.assign(each.path.slots.begin(), each.path.slots.begin() + each.path.slot_count);
    field->offset = each.path.offset;
    field->default_value = std::make_unique<Number>(number_of(each.default_value));
    entry->fields.push_back(std::move(field));
  }
  return entry;
}

std::string refusal_of(const flatbuffers::String& text) {
  constexpr std::size_t kRefusalSizeMax = 1024;
  return printable(text.string_view(), kRefusalSizeMax);
}

}  // namespace rtpm::events
