#include "checks/conform_types.hpp"

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "model/spelling.hpp"
#include "model/words.hpp"

namespace rtpm::schema {
namespace {

constexpr Reading kBytesFail{.new_reads_old = false, .old_reads_new = false};
constexpr Reading kMeaningFails{
    .new_reads_old = false, .old_reads_new = false, .is_by_meaning = true};
constexpr Reading kNothingFails{};

/// Whether the field is the type field that FlatBuffers adds to a union or vector of unions.
bool is_companion(const Field& field) noexcept {
  return field.type.innermost() == BaseType::kUnionType;
}

std::string quoted(const std::string& text) {
  return '`' + text + '`';
}

std::string field_words(const Object& owner, const Field& field) {
  return "field " + quoted(field.name) + " of " + (owner.is_struct ? "struct " : "table ") +
         quoted(owner.name);
}

std::string value_words(const Enum& owner, const EnumValue& value) {
  return "value " + quoted(value.name) + " of " + (owner.is_union ? "union " : "enum ") +
         quoted(owner.name);
}

std::string attribute_value(const Field& field, std::string_view name) {
  for (const Attribute& attribute : field.attributes) {
    if (attribute.name == name) return attribute.value;
  }
  return {};
}

/// Whether a field's bytes have the same layout in both versions, ignoring names.
bool is_same_shape(const Model& before, const Type& a, const Model& after, const Type& b) {
  if (a.base != b.base || a.element != b.element || a.fixed_length != b.fixed_length) return false;
  if (!a.index || !b.index) return true;
  if (a.innermost() != BaseType::kObject) return a.innermost() != BaseType::kUnion;
  const Object& x = before.objects[*a.index];
  const Object& y = after.objects[*b.index];
  if (x.is_struct != y.is_struct || x.fields.size() != y.fields.size()) return false;
  return std::equal(
      x.fields.begin(), x.fields.end(), y.fields.begin(), [](const Field& f, const Field& g) {
        return f.type.base == g.type.base && f.type.element == g.type.element &&
               f.offset == g.offset && f.is_required == g.is_required &&
               f.default_integer == g.default_integer && !(f.default_real < g.default_real) &&
               !(g.default_real < f.default_real);
      });
}

}  // namespace

void TypeComparison::report(ChangeKind kind, Reading reading, const std::string& owner,
                            const Location& now, const Location& then, std::string message,
                            std::string hint) {
  Change change{.kind = kind,
                .reading = reading,
                .owner = owner,
                .diagnostic = {now, std::move(message), std::move(hint), std::nullopt}};
  if (then.line != 0) change.diagnostic.note = Note{then, "it was this"};
  changes_.push_back(std::move(change));
}

void TypeComparison::compare(const Object& before, const Object& after) {
  if (before.is_struct != after.is_struct) {
    report(ChangeKind::kTypeKind, kBytesFail, after.name, after.location, before.location,
           quoted(after.name) + " was a " + (before.is_struct ? "struct" : "table") +
               ", and is a " + (after.is_struct ? "struct" : "table"),
           "give the new one a name of its own");
    return;
  }
  if (after.is_struct) {
    compare_structs(before, after);
  } else {
    compare_tables(before, after);
  }
  if (before.event_id == after.event_id) return;
  if (!before.event_id) {
    report(ChangeKind::kEventAdded, kNothingFails, after.name, after.location, before.location,
           "table " + quoted(after.name) + " became event " + std::to_string(*after.event_id), "");
    return;
  }
  report(ChangeKind::kEventChanged, kBytesFail, after.name, after.location, before.location,
         "event " + quoted(after.name) + " had the number " + std::to_string(*before.event_id) +
             ", and has " + (after.event_id ? std::to_string(*after.event_id) : "none"),
         "keep the number: it is what tells events apart");
}

void TypeComparison::compare_structs(const Object& before, const Object& after) {
  const std::size_t count = std::min(before.fields.size(), after.fields.size());
  const auto is_same = [&](std::size_t i) {
    const Field& a = before.fields[i];
    const Field& b = after.fields[i];
    return a.offset == b.offset && a.type.base == b.type.base && a.type.element == b.type.element &&
           a.type.fixed_length == b.type.fixed_length &&
           referred_name(before_, a.type) == referred_name(after_, b.type);
  };
  std::size_t same = 0;
  while (same < count && is_same(same))
    ++same;
  const bool is_whole = same == before.fields.size() && same == after.fields.size();
  if (!is_whole || before.byte_size != after.byte_size || before.alignment != after.alignment) {
    const bool is_after = same < after.fields.size();
    const bool is_before = same < before.fields.size();
    // A field that replaces padding does not move other fields.
    Reading reading = kBytesFail;
    reading.is_by_meaning = before.byte_size == after.byte_size && same == count;
    report(ChangeKind::kStructLayout, reading, after.name,
           is_after ? after.fields[same].location : after.location,
           is_before ? before.fields[same].location : before.location,
           "struct " + quoted(after.name) + " of " + std::to_string(before.byte_size) +
               " bytes changed to one of " + std::to_string(after.byte_size) + " bytes, from " +
               (is_after ? "field " + quoted(after.fields[same].name) : std::string("its end")) +
               " on",
           "a struct cannot change: give the new one a name of its own, and a new method");
    return;
  }
  for (std::size_t i = 0; i < same; ++i) {
    const Field& a = before.fields[i];
    const Field& b = after.fields[i];
    if (a.name != b.name) {
      report(ChangeKind::kFieldRenamed, kMeaningFails, after.name, b.location, a.location,
             field_words(after, b) + " was named " + quoted(a.name),
             "the bytes stay, their meaning may not: keep the name, or make a new struct");
    }
    compare_meaning(after, a, b);
  }
}

void TypeComparison::compare_tables(const Object& before, const Object& after) {
  if (!compare_places(before, after)) return;
  std::size_t i = 0;
  for (; i < before.fields.size() && i < after.fields.size(); ++i) {
    if (!is_companion(before.fields[i]) || !is_companion(after.fields[i])) {
      compare_fields(after, before.fields[i], after.fields[i]);
    }
  }
  for (std::size_t j = i; j < before.fields.size(); ++j) {
    if (!is_companion(before.fields[j])) remove_field(before, before.fields[j], after);
  }
  for (std::size_t j = i; j < after.fields.size(); ++j) {
    if (!is_companion(after.fields[j])) add_field(after, after.fields[j]);
  }
}

/// Whether all fields kept their slots. Reports any number of moved fields as one change.
bool TypeComparison::compare_places(const Object& before, const Object& after) {
  std::unordered_map<std::string_view, const Field*> old_fields;
  for (const Field& field : before.fields)
    old_fields.emplace(field.name, &field);
  const Field* first = nullptr;
  std::size_t count = 0;
  for (const Field& field : after.fields) {
    const auto old = old_fields.find(field.name);
    if (old == old_fields.end() || old->second->id == field.id || is_companion(field)) continue;
    if (first == nullptr) first = &field;
    ++count;
  }
  if (first == nullptr) return true;
  std::string message = field_words(after, *first) + " had the slot " +
                        std::to_string(old_fields[first->name]->id) + ", and has " +
                        std::to_string(first->id);
  if (count > 1) message += ", and " + std::to_string(count - 1) + " more moved";
  report(ChangeKind::kFieldMoved, kBytesFail, after.name, first->location,
         old_fields[first->name]->location, std::move(message),
         "add new fields behind the last one, or give all fields the id that they had: (id: N)");
  return false;
}

void TypeComparison::add_field(const Object& owner, const Field& field) {
  if (field.is_required) {
    report(ChangeKind::kFieldAddedRequired, {.new_reads_old = false}, owner.name, field.location,
           {}, field_words(owner, field) + " is new and required: older data lack it",
           "make it optional, and document what its absence means");
    return;
  }
  report(ChangeKind::kFieldAdded, kNothingFails, owner.name, field.location, {},
         field_words(owner, field) + " is new", "");
}

void TypeComparison::remove_field(const Object& owner, const Field& field, const Object& now) {
  Reading reading = kMeaningFails;
  // A newer writer omits it, and an older reader rejects a table that lacks a required field.
  reading.is_by_meaning = !field.is_required;
  report(ChangeKind::kFieldRemoved, reading, owner.name, field.location, {},
         field_words(owner, field) + " is removed, so its slot may get another meaning",
         "keep it in the schema, as " +
             quoted(field.name + ":" + type_text(before_, field.type) + " (deprecated);"));
  if (now.location.line != 0) {
    changes_.back().diagnostic.note = Note{now.location, "the table is here now"};
  }
}

void TypeComparison::compare_fields(const Object& owner, const Field& before, const Field& after) {
  const bool is_renamed = before.name != after.name;
  if (!compare_types(owner, before, after)) return;
  if (is_renamed) {
    report(ChangeKind::kFieldRenamed, kMeaningFails, owner.name, after.location, before.location,
           field_words(owner, after) + " was named " + quoted(before.name),
           "the bytes stay, their meaning may not: deprecate the old field and add a new one");
  }
  compare_presence(owner, before, after);
  compare_defaults(owner, before, after);
  compare_meaning(owner, before, after);
}

/// Whether the types are equal; reports it if not.
bool TypeComparison::compare_types(const Object& owner, const Field& before, const Field& after) {
  const std::string old_reference = referred_name(before_, before.type);
  const std::string new_reference = referred_name(after_, after.type);
  const bool is_same_reference = old_reference == new_reference;
  // A change of an enum's underlying type is reported for the enum.
  const bool is_enum = !old_reference.empty() && is_same_reference &&
                       before.type.innermost() != BaseType::kObject &&
                       after.type.innermost() != BaseType::kObject;
  const bool is_same = is_same_reference && before.type.is_many() == after.type.is_many() &&
                       before.type.fixed_length == after.type.fixed_length &&
                       (is_enum || (before.type.base == after.type.base &&
                                    before.type.element == after.type.element));
  if (is_same) return true;
  Reading reading = kBytesFail;
  reading.is_by_meaning = is_same_shape(before_, before.type, after_, after.type);
  report(ChangeKind::kFieldRetyped, reading, owner.name, after.location, before.location,
         field_words(owner, after) + " was " + quoted(type_text(before_, before.type)) +
             ", and is " + quoted(type_text(after_, after.type)),
         "deprecate the field and add one with another name and the new type");
  return false;
}

void TypeComparison::compare_presence(const Object& owner, const Field& before,
                                      const Field& after) {
  const std::string words = field_words(owner, after);
  if (before.is_deprecated != after.is_deprecated) {
    const bool is_missed = before.is_required && !before.is_deprecated;
    const bool is_wanted = after.is_required && !after.is_deprecated;
    report(after.is_deprecated ? ChangeKind::kFieldDeprecated : ChangeKind::kFieldUndeprecated,
           {.new_reads_old = !is_wanted, .old_reads_new = !is_missed}, owner.name, after.location,
           before.location,
           words + (after.is_deprecated ? " is deprecated" : " is no longer deprecated") +
               (is_missed || is_wanted ? ", and required by the other side" : ""),
           is_missed || is_wanted ? "a required field cannot be added or removed: keep it as it is"
                                  : "");
    return;
  }
  if (after.is_deprecated || before.is_required == after.is_required) return;
  if (after.is_required) {
    report(ChangeKind::kFieldRequired, {.new_reads_old = false}, owner.name, after.location,
           before.location, words + " became required: older data may lack it",
           "keep it optional, and document what its absence means");
  } else {
    report(ChangeKind::kFieldNotRequired, {.old_reads_new = false}, owner.name, after.location,
           before.location, words + " is no longer required: older readers need it",
           "keep it required, and add another field for the new case");
  }
}

void TypeComparison::compare_defaults(const Object& owner, const Field& before,
                                      const Field& after) {
  const bool is_scalar = after.type.base <= BaseType::kDouble;
  if (!is_scalar || after.is_deprecated || before.is_deprecated) return;
  const std::string old_default = default_text(before_, before);
  const std::string new_default = default_text(after_, after);
  // A renamed or renumbered enum value is reported for the enum.
  const bool is_same_number = after.type.index && !after.is_optional && !before.is_optional &&
                              after.default_integer == before.default_integer;
  if (old_default == new_default || is_same_number) return;
  report(ChangeKind::kFieldDefault, kBytesFail, owner.name, after.location, before.location,
         field_words(owner, after) + " had the default " + quoted(old_default) + ", and has " +
             quoted(new_default),
         "a default is not sent, each side uses its own: keep it, or add a new field");
}

void TypeComparison::compare_meaning(const Object& owner, const Field& before, const Field& after) {
  const std::string words = field_words(owner, after);
  const auto changed = [&](ChangeKind kind, Reading reading, const std::string& what,
                           const std::string& then, const std::string& now, const char* hint) {
    report(kind, reading, owner.name, after.location, before.location,
           words + " had the " + what + ' ' + (then.empty() ? "unstated" : quoted(then)) +
               ", and has " + (now.empty() ? "none" : quoted(now)),
           hint);
  };
  const auto fails_if_stated = [](const std::string& then) {
    return then.empty() ? kNothingFails : kMeaningFails;
  };
  if (before.unit != after.unit) {
    changed(ChangeKind::kFieldUnit, fails_if_stated(before.unit), "unit", before.unit, after.unit,
            before.unit.empty() ? "" : "a number in another unit is another field: add a new one");
  }
  if (before.frame != after.frame) {
    changed(ChangeKind::kFieldFrame, fails_if_stated(before.frame), "frame", before.frame,
            after.frame,
            before.frame.empty() ? "" : "a value in another frame is another field: add a new one");
  }
  for (const char* encoding : {"nested_flatbuffer", "flexbuffer", "force_align"}) {
    const std::string then = attribute_value(before, encoding);
    const std::string now = attribute_value(after, encoding);
    if (then == now) continue;
    changed(ChangeKind::kFieldEncoding, kMeaningFails, encoding, then, now,
            "deprecate the field and add a new one");
  }
  if (before.is_key != after.is_key) {
    report(ChangeKind::kFieldKey, kMeaningFails, owner.name, after.location, before.location,
           words + (after.is_key ? " became a key" : " is no longer a key") +
               ": one side sorts by it, the other does not",
           "keep the key as it is");
  }
  const auto range_text = [](const Field& field) {
    return field.range ? number_text(field.range->low) + ".." + number_text(field.range->high)
                       : std::string{};
  };
  if (range_text(before) == range_text(after)) return;
  const bool is_narrower = after.range && (!before.range || after.range->low > before.range->low ||
                                           after.range->high < before.range->high);
  const bool is_wider = before.range && (!after.range || after.range->low < before.range->low ||
                                         after.range->high > before.range->high);
  changed(is_narrower ? ChangeKind::kFieldRangeNarrowed : ChangeKind::kFieldRangeWidened,
          {.new_reads_old = !is_narrower, .old_reads_new = !is_wider, .is_by_meaning = true},
          "range", range_text(before), range_text(after),
          "one side may send values that the other refuses: keep the range");
}

struct TypeComparison::ValueIndex {
  explicit ValueIndex(const Enum& enumeration) {
    for (const EnumValue& value : enumeration.values) {
      by_name.emplace(value.name, &value);
      by_number.emplace(value.value, &value);
    }
  }
  std::map<std::string_view, const EnumValue*> by_name{};
  std::map<std::int64_t, const EnumValue*> by_number{};
};

void TypeComparison::compare(const Enum& before, const Enum& after) {
  if (before.is_union != after.is_union || before.underlying != after.underlying) {
    const bool is_kind = before.is_union != after.is_union;
    const auto kind_of = [&](const Enum& enumeration) {
      return is_kind ? with_article(enumeration.is_union ? "union" : "enum")
                     : quoted(std::string(spelling_of(enumeration.underlying)));
    };
    report(is_kind ? ChangeKind::kTypeKind : ChangeKind::kEnumUnderlying, kBytesFail, after.name,
           after.location, before.location,
           quoted(after.name) + " was " + kind_of(before) + ", and is " + kind_of(after),
           "give the new one a name of its own");
    return;
  }
  const ValueIndex old_values(before);
  const ValueIndex new_values(after);
  // Removing a value in the middle renumbers all later ones, so it is reported as one change.
  for (const EnumValue& value : before.values) {
    const auto named = new_values.by_name.find(value.name);
    if (named == new_values.by_name.end() || named->second->value == value.value) continue;
    const EnumValue& now = *named->second;
    report(ChangeKind::kEnumValueRenumbered, kBytesFail, after.name, now.location, value.location,
           value_words(after, now) + " was " + std::to_string(value.value) + ", and is " +
               std::to_string(now.value),
           "add new values behind the last one, or give them their numbers: `Name = N`");
    return;
  }
  for (const EnumValue& value : before.values)
    compare_value(after, value, old_values, new_values);
  for (const EnumValue& value : after.values) {
    if (old_values.by_name.contains(value.name) || old_values.by_number.contains(value.value)) {
      continue;
    }
    report(ChangeKind::kEnumValueAdded, kNothingFails, after.name, value.location, {},
           value_words(after, value) + " is new: older readers have no name for its number", "");
  }
}

void TypeComparison::compare_value(const Enum& owner, const EnumValue& before,
                                   const ValueIndex& old_values, const ValueIndex& new_values) {
  const auto named = new_values.by_name.find(before.name);
  const auto numbered = new_values.by_number.find(before.value);
  if (named != new_values.by_name.end()) {
    const EnumValue& now = *named->second;
    const std::string old_type = type_text(before_, before.union_type);
    const std::string new_type = type_text(after_, now.union_type);
    if (!owner.is_union || old_type == new_type) return;
    Reading reading = kBytesFail;
    reading.is_by_meaning = is_same_shape(before_, before.union_type, after_, now.union_type);
    report(ChangeKind::kUnionMemberRetyped, reading, owner.name, now.location, before.location,
           value_words(owner, now) + " was " + quoted(old_type) + ", and is " + quoted(new_type),
           "add a new member behind the last one");
  } else if (numbered != new_values.by_number.end() &&
             !old_values.by_name.contains(numbered->second->name)) {
    report(ChangeKind::kEnumValueRenamed, kMeaningFails, owner.name, numbered->second->location,
           before.location,
           value_words(owner, *numbered->second) + " was named " + quoted(before.name),
           "the number may get another meaning: keep the name, or use a new number");
  } else {
    report(ChangeKind::kEnumValueRemoved,
           {.new_reads_old = false, .old_reads_new = true, .is_by_meaning = true}, owner.name,
           before.location, {},
           value_words(owner, before) + " is removed, and older data may have its number",
           "keep it, and mark it in its comment as no longer used");
  }
}

}  // namespace rtpm::schema
