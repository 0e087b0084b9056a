#include "checks/type_checker.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "checks/attribute_reader.hpp"
#include "model/words.hpp"

namespace rtpm::schema {
namespace {

/// Parses "low..high".
std::optional<Range> to_range(std::string_view text) {
  const std::size_t dots = text.find("..");
  if (dots == std::string_view::npos) return std::nullopt;
  const auto number = [](std::string_view digits) -> std::optional<double> {
    double value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc{} || end != digits.data() + digits.size()) return std::nullopt;
    return std::isfinite(value) ? std::optional(value) : std::nullopt;
  };
  const auto low = number(text.substr(0, dots));
  const auto high = number(text.substr(dots + 2));
  if (!low || !high) return std::nullopt;
  return Range{*low, *high};
}

bool is_number(const Type& type) noexcept {
  const BaseType base = type.innermost();
  return base >= BaseType::kInt8 && base <= BaseType::kDouble && !type.index;
}

bool is_real(const Type& type) noexcept {
  return type.innermost() == BaseType::kFloat || type.innermost() == BaseType::kDouble;
}

Range limits_of(BaseType type) noexcept {
  constexpr double kLimits[][2] = {{-128, 127},
                                   {0, 255},
                                   {-32768, 32767},
                                   {0, 65535},
                                   {-2147483648.0, 2147483647.0},
                                   {0, 4294967295.0},
                                   {-9223372036854775808.0, 9223372036854775807.0},
                                   {0, 18446744073709551615.0}};
  const auto index = static_cast<std::size_t>(type) - static_cast<std::size_t>(BaseType::kInt8);
  return {kLimits[index][0], kLimits[index][1]};
}

double default_of(const Field& field) noexcept {
  if (is_real(field.type)) return field.default_real;
  return field.type.base == BaseType::kUint64
             ? static_cast<double>(static_cast<std::uint64_t>(field.default_integer))
             : static_cast<double>(field.default_integer);
}

constexpr std::size_t kStructSizeMax = 65535;  // Bytes.
// The range of event numbers reserved for devices and recordings: spec/events.md, section 1.
constexpr std::uint32_t kOwnEventMin = 1380974592;
constexpr std::uint32_t kOwnEventMax = 1380975615;

constexpr std::size_t kStructDepthMax = 64;  // Structs within structs.

class TypeChecker {
 public:
  TypeChecker(Model& model, Diagnostics& errors) : model_(model), errors_(errors) {
    for (std::size_t i = 0; i < model.objects.size(); ++i)
      objects_.emplace(model.objects[i].name, i);
    for (std::size_t i = 0; i < model.enums.size(); ++i)
      enums_.emplace(model.enums[i].name, i);
  }

  void check(const SchemaText& text) {
    for (const TypeOutline& outline : text.outline().types) {
      if (const auto object = objects_.find(outline.name); object != objects_.end()) {
        check_object(model_.objects[object->second], outline, text);
      } else if (const auto found = enums_.find(outline.name); found != enums_.end()) {
        check_enum(model_.enums[found->second], outline, text);
      }
    }
  }

  /// Limits the nesting of structs, so that code may walk them recursively.
  void check_nesting() {
    std::vector<std::size_t> depths(model_.objects.size(), 1);
    const Object* deep = nullptr;
    while (deep == nullptr && deepen(depths, deep)) {
    }
    if (deep == nullptr) return;
    errors_.push_back({deep->location,
                       "struct `" + short_name(deep->name) + "` has structs within structs, more " +
                           "than " + std::to_string(kStructDepthMax) + " deep",
                       "put fewer of them into each other", std::nullopt});
  }

 private:
  /// Sets each struct's depth from its fields' depths; `deep` is one that exceeds the limit.
  /// Returns whether a depth changed.
  bool deepen(std::vector<std::size_t>& depths, const Object*& deep) const {
    bool is_changed = false;
    for (std::size_t i = 0; i < depths.size(); ++i) {
      if (!model_.objects[i].is_struct) continue;
      for (const Field& field : model_.objects[i].fields) {
        if (!field.type.has_object() || depths[*field.type.index] < depths[i]) continue;
        depths[i] = depths[*field.type.index] + 1;
        is_changed = true;
      }
      if (depths[i] > kStructDepthMax) deep = &model_.objects[i];
    }
    return is_changed;
  }

  void check_object(Object& object, const TypeOutline& outline, const SchemaText& text) {
    const AttributeReader reader(text, errors_);
    const std::string owner = outline.kind + " `" + short_name(outline.name) + "`";
    object.location = text.locate(outline.at);
    std::set<std::string> seen;
    for (const AttributeUse& use : outline.attributes) {
      if (!reader.is_first(use, seen)) continue;
      if (object.is_struct && use.name == "rtpm_event") {
        reader.report_no_effect(use, owner, "an event is a table: wrap the struct in one");
      } else if (const auto value = reader.read(use, AttributePlace::kTable, owner)) {
        object.event_id = static_cast<std::uint32_t>(value->number);
        check_event(object, use, text, reader);
      }
    }
    std::unordered_map<std::string_view, Field*> fields;
    for (Field& field : object.fields)
      fields.emplace(field.name, &field);
    for (const MemberOutline& member : outline.members) {
      const auto field = fields.find(member.name);
      if (field == fields.end()) continue;
      // FlatBuffers' parser accepts a struct that contains itself; walking it would never end.
      if (object.is_struct && field->second->type.has_object() &&
          &model_.objects[*field->second->type.index] == &object) {
        reader.report(member.at, owner + " contains itself, so it has no size",
                      "make it a table, whose fields may be absent");
      }
      check_field(*field->second, object.is_struct, owner, member, text);
    }
    // The fields have 16-bit offsets.
    if (object.is_struct && object.byte_size > kStructSizeMax) {
      reader.report(outline.at,
                    owner + " has " + std::to_string(object.byte_size) + " bytes, and at most " +
                        std::to_string(kStructSizeMax) + " can be",
                    "make it a table, with a vector instead of the array");
    }
  }

  void check_event(const Object& object, const AttributeUse& use, const SchemaText& text,
                   const AttributeReader& reader) {
    const bool is_own = object.name.starts_with("rtpm.");
    if (*object.event_id >= kOwnEventMin && *object.event_id <= kOwnEventMax && !is_own) {
      reader.report_value(use, "the numbers " + std::to_string(kOwnEventMin) + " to " +
                                   std::to_string(kOwnEventMax) + " belong to RTPM's own events");
    }
    const auto [other, is_new] = events_.emplace(*object.event_id, &object);
    if (is_new) {
      event_places_.emplace(*object.event_id, text.locate(use.value_at));
      return;
    }
    errors_.push_back({text.locate(use.value_at),
                       "tables `" + other->second->name + "` and `" + object.name +
                           "` have the same rtpm_event " + std::to_string(*object.event_id),
                       "the next free number is " + std::to_string(events_.rbegin()->first + 1ull),
                       Note{event_places_.at(*object.event_id), "it is used here first"}});
  }

  void check_field(Field& field, bool is_in_struct, const std::string& owner_type,
                   const MemberOutline& member, const SchemaText& text) {
    const AttributeReader reader(text, errors_);
    field.location = text.locate(member.at);
    const std::string owner = "field `" + field.name + "` of " + owner_type;
    std::set<std::string> seen;
    for (const AttributeUse& use : member.attributes) {
      if (!reader.is_first(use, seen)) continue;
      const auto value = reader.read(use, AttributePlace::kField, owner);
      if (!value) continue;
      const bool is_range = use.name == "rtpm_range";
      if (!is_number(field.type) && (is_range || !field.type.has_object())) {
        reader.report_no_effect(use, owner,
                                is_range ? "only numbers, and vectors and arrays of them, have a "
                                           "range: remove it, or state it on the struct's fields"
                                         : "only numbers, structs and tables, and vectors and "
                                           "arrays of them, have one: remove it");
      } else if (is_range) {
        check_range(field, is_in_struct, use, reader);
      } else if (use.name == "rtpm_unit") {
        field.unit = value->text;
      } else {
        field.frame = value->text;
      }
    }
  }

  static void check_range(Field& field, bool is_in_struct, const AttributeUse& use,
                          const AttributeReader& reader) {
    const std::optional<Range> range = to_range(*use.value);
    if (!range) return reader.report_value(use, value_hint(use.name));
    if (range->low > range->high) {
      return reader.report_value(use,
                                 "the low end comes first, and it is larger than the high end");
    }
    if (!is_real(field.type)) {
      const Range limits = limits_of(field.type.innermost());
      const bool is_whole =
          std::floor(range->low) == range->low && std::floor(range->high) == range->high;
      if (!is_whole || range->low < limits.low || range->high > limits.high) {
        return reader.report_value(use, "both ends must be values of the field's type");
      }
    }
    const bool has_default = !is_in_struct && field.type.base <= BaseType::kDouble &&
                             !field.is_optional && !field.is_deprecated;
    const double value = default_of(field);
    if (has_default && (value < range->low || value > range->high)) {
      return reader.report(use.value_at,
                           "the default of field `" + field.name + "`, " + number_text(value) +
                               ", is outside its range",
                           "give it another default, or none with `= null`");
    }
    field.range = range;
  }

  void check_enum(Enum& enumeration, const TypeOutline& outline, const SchemaText& text) {
    enumeration.location = text.locate(outline.at);
    check_enum_attributes(outline, text);
    for (const MemberOutline& member : outline.members) {
      // In a union, `lab.Pose` is the value `lab_Pose`, and `alias:lab.Pose` is the value `alias`.
      std::string name = member.name;
      std::replace(name.begin(), name.end(), '.', '_');
      for (EnumValue& value : enumeration.values) {
        if (value.name == name) value.location = text.locate(member.at);
      }
    }
  }

  /// Refuses all RTPM attributes on enums and unions.
  void check_enum_attributes(const TypeOutline& outline, const SchemaText& text) {
    const AttributeReader reader(text, errors_);
    const std::string owner = outline.kind + " `" + short_name(outline.name) + "`";
    for (const AttributeUse& use : outline.attributes) {
      if (!use.name.starts_with("rtpm_")) continue;
      const KnownAttribute* known = find_attribute(use.name);
      if (known == nullptr) {
        (void)reader.read(use, AttributePlace::kTable, owner);
      } else {
        reader.report_no_effect(
            use, owner,
            "it belongs on " + std::string(words_of(known->place)) + "; remove it here");
      }
    }
  }

  Model& model_;
  Diagnostics& errors_;
  std::unordered_map<std::string_view, std::size_t> objects_{};
  std::unordered_map<std::string_view, std::size_t> enums_{};
  std::map<std::uint32_t, const Object*> events_{};
  std::map<std::uint32_t, Location> event_places_{};
};

}  // namespace

void check_types(Model& model, const std::deque<SchemaText>& texts, Diagnostics& errors) {
  TypeChecker checker(model, errors);
  for (const SchemaText& text : texts) {
    checker.check(text);
  }
  if (errors.empty()) checker.check_nesting();
}

}  // namespace rtpm::schema
