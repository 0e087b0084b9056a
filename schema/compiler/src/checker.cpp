#include "checker.hpp"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "attributes.hpp"
#include "words.hpp"

namespace rtpm::schema {
namespace {

// The features of FlatBuffers 2.0.8 (fixed arrays, unions of structs, optional scalars, default
// strings and vectors). A schema with others was made by a parser that knows more than this code.
constexpr std::uint64_t kKnownFeatureBits = 0xF;

// A payload begins at a multiple of 16 bytes, so nothing in it can be aligned to more.
constexpr std::size_t kAlignmentMax = 16;

constexpr std::uint32_t kMethodIdMax = 65535;

/// The number that all of `text` is, in decimal digits; nothing if it is none or larger than 2⁶⁴
/// - 1.
std::optional<std::uint64_t> to_number(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

class Checker {
 public:
  Checker(Model& model, const SourceFile& source, const Outline& text)
      : model_(model), source_(source), text_(text) {}

  Diagnostics check() {
    check_features();
    place_types();
    for (const OtherAttribute& other : text_.other_attributes)
      check_misplaced(other);
    sort_services();
    for (std::size_t i = 0; i < model_.services.size(); ++i) {
      check_service(model_.services[i], text_.services[i]);
    }
    return std::move(errors_);
  }

 private:
  void report(Span span, std::string message, std::string hint) {
    errors_.push_back({source_.locate(span), std::move(message), std::move(hint), std::nullopt});
  }

  void check_features() {
    const std::uint64_t unknown = model_.feature_bits & ~kKnownFeatureBits;
    if (unknown == 0) return;
    errors_.push_back(
        {Location{.file = source_.path()},
         "the schema uses features of FlatBuffers that this rtpmc does not know (bits " +
             std::to_string(unknown) + ")",
         "use a newer rtpmc, or do without the feature", std::nullopt});
  }

  void place_types() {
    for (const Token& name : text_.namespaces) {
      model_.namespaces.push_back({std::string(name.text), source_.locate(name.span())});
    }
    for (const TypeOutline& type : text_.types) {
      for (Object& object : model_.objects) {
        if (object.name == type.name) object.location = source_.locate(type.at);
      }
      for (Enum& enumeration : model_.enums) {
        if (enumeration.name == type.name) enumeration.location = source_.locate(type.at);
      }
    }
  }

  void check_misplaced(const OtherAttribute& other) {
    if (!other.use.name.starts_with("rtpm_")) return;
    const KnownAttribute* known = find_attribute(other.use.name);
    check_no_effect(other.use, other.owner,
                    known ? "it belongs on " + std::string(known->place) + "; remove it here" : "");
  }

  /// Into the order of the text: the reflection has the services by name.
  void sort_services() {
    std::vector<Service> sorted;
    for (const ServiceOutline& outline : text_.services) {
      for (Service& service : model_.services) {
        if (service.name == outline.name) sorted.push_back(std::move(service));
      }
    }
    model_.services = std::move(sorted);
  }

  void check_service(Service& service, const ServiceOutline& outline) {
    service.location = source_.locate(outline.at);
    for (const AttributeUse& use : outline.attributes) {
      check_no_effect(
          use, "a service",
          is_known_attribute(use.name) ? "it belongs on its methods, one by one" : "remove it");
    }
    missing_id_count_ = 0;
    const std::string of_service = " of service `" + service.name + "`";
    for (std::size_t i = 0; i < service.methods.size(); ++i) {
      check_method(service, i, outline.methods[i], of_service);
    }
    check_clashes(service, outline);
  }

  /// An attribute of RTPM or FlatBuffers that says nothing where it stands; those of other tools
  /// are their own affair.
  void check_no_effect(const AttributeUse& use, const std::string& place, const std::string& hint) {
    if (use.name.starts_with("rtpm_") && !is_known_attribute(use.name)) {
      report(use.at, "unknown attribute `" + use.name + "`", unknown_attribute_hint(use.name));
    } else if (is_known_attribute(use.name) || is_flatbuffers_attribute(use.name)) {
      report(use.at, "`" + use.name + "` has no effect on " + place, hint);
    }
  }

  void check_method(Service& service, std::size_t index, const MethodOutline& outline,
                    const std::string& of_service) {
    Method& method = service.methods[index];
    method.location = source_.locate(outline.at);
    std::set<std::string> seen;
    for (const AttributeUse& use : outline.attributes) {
      if (!seen.insert(use.name).second) {
        report(use.at, "`" + use.name + "` is stated twice", "keep one of the two");
      } else {
        check_attribute(method, use);
      }
    }
    if (!seen.contains("rtpm_id")) {
      report(outline.at, "method `" + method.name + "`" + of_service + " has no rtpm_id",
             "give it a number that no method of the service ever had: (rtpm_id: " +
                 std::to_string(free_id(service) + missing_id_count_++) + ")");
    }
    check_payload(method.request, outline.request_at, "request", outline.request);
    check_payload(method.reply, outline.reply_at, "reply", outline.reply);
  }

  void check_attribute(Method& method, const AttributeUse& use) {
    if (const KnownAttribute* known = find_attribute(use.name)) {
      const std::optional<std::uint64_t> number = value_of(use, *known);
      if (!number) return;
      if (use.name == "rtpm_id") method.id = static_cast<std::uint16_t>(*number);
      if (use.name == "rtpm_deadline_us") method.deadline_us = static_cast<std::uint32_t>(*number);
      if (use.name == "rtpm_idempotent") method.is_idempotent = true;
    } else {
      const bool has_counterpart = is_known_attribute("rtpm_" + use.name);
      check_no_effect(use, "a method",
                      has_counterpart ? "did you mean `rtpm_" + use.name + "`?" : "remove it");
    }
  }

  /// The attribute's number, 1 for one that takes none; reports a value that is wrong or lacks.
  std::optional<std::uint64_t> value_of(const AttributeUse& use, const KnownAttribute& known) {
    if (known.max == 0) {
      if (!use.value) return 1;
      report(use.value_at, "`" + use.name + "` takes no value", value_hint(use.name));
      return std::nullopt;
    }
    if (!use.value) {
      report(use.at, "`" + use.name + "` needs a value", value_hint(use.name));
      return std::nullopt;
    }
    const std::optional<std::uint64_t> number = to_number(*use.value);
    if (number && *number >= 1 && *number <= known.max) return number;
    report(use.value_at, "`" + *use.value + "` is no value for `" + use.name + "`",
           value_hint(use.name));
    return std::nullopt;
  }

  /// One more than the largest id of the service's methods, as far as they are read.
  [[nodiscard]] static std::uint32_t free_id(const Service& service) {
    std::uint64_t largest = 0;
    for (const Method& method : service.methods) {
      for (const Attribute& attribute : method.attributes) {
        if (attribute.name != "rtpm_id") continue;
        const std::uint64_t value = to_number(attribute.value).value_or(0);
        if (value < kMethodIdMax) largest = std::max(largest, value);
      }
    }
    return static_cast<std::uint32_t>(largest + 1);
  }

  void check_clashes(const Service& service, const ServiceOutline& outline) {
    for (std::size_t i = 0; i < service.methods.size(); ++i) {
      for (std::size_t j = 0; j < i && service.methods[i].id != 0; ++j) {
        if (service.methods[i].id != service.methods[j].id) continue;
        errors_.push_back(
            {source_.locate(id_span(outline.methods[i])),
             "methods `" + service.methods[j].name + "` and `" + service.methods[i].name +
                 "` of service `" + service.name + "` have the same rtpm_id " +
                 std::to_string(service.methods[i].id),
             "the next free number is " + std::to_string(free_id(service)),
             Note{source_.locate(id_span(outline.methods[j])), "it is used here first"}});
        break;
      }
    }
  }

  [[nodiscard]] static Span id_span(const MethodOutline& outline) {
    for (const AttributeUse& use : outline.attributes) {
      if (use.name == "rtpm_id") return use.value_at;
    }
    return outline.at;
  }

  void check_payload(const Payload& payload, Span span, const std::string& role,
                     const std::string& type) {
    const Object& object = model_.objects[payload.table];
    // FlatBuffers' parser says so itself, but not of a struct that is defined behind the service.
    if (object.is_struct) {
      report(span, "a " + role + " must be a table, and `" + type + "` is a struct",
             wrap_struct_hint(type));
      return;
    }
    if (const Object* aligned = find_overaligned(payload.table)) {
      report(span,
             "`" + aligned->name + "`, which is part of this " + role + ", is aligned to " +
                 std::to_string(aligned->alignment) + " bytes",
             "a payload begins at a multiple of 16 bytes: lower its force_align to at most 16");
    }
  }

  /// A struct aligned to more than a payload is, among all that is reached from `index`.
  [[nodiscard]] const Object* find_overaligned(std::size_t index) const {
    std::set<std::size_t> seen;
    std::vector<std::size_t> open{index};
    while (!open.empty()) {
      const std::size_t at = open.back();
      open.pop_back();
      if (!seen.insert(at).second) continue;
      const Object& object = model_.objects[at];
      if (object.alignment > kAlignmentMax) return &object;
      for (const Field& field : object.fields) {
        if (!field.type.index) continue;
        if (field.type.base == BaseType::kObject || field.type.element == BaseType::kObject) {
          open.push_back(*field.type.index);
          continue;
        }
        for (const EnumValue& value : model_.enums[*field.type.index].values) {
          if (value.union_type.base == BaseType::kObject) open.push_back(*value.union_type.index);
        }
      }
    }
    return nullptr;
  }

  Model& model_;
  const SourceFile& source_;
  const Outline& text_;
  Diagnostics errors_{};
  std::uint32_t missing_id_count_ = 0;  // In the service at hand, so that each gets its own hint.
};

}  // namespace

Diagnostics check(Model& model, const SourceFile& source, const Outline& text) {
  return Checker(model, source, text).check();
}

}  // namespace rtpm::schema
