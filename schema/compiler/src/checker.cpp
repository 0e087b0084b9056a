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

namespace rtpm::schema {
namespace {

// The features of FlatBuffers 2.0.8 (fixed arrays, unions of structs, optional scalars, default
// strings and vectors). A schema with others was made by a parser that knows more than this code.
constexpr std::uint64_t kKnownFeatureBits = 0xF;

// A payload begins at a multiple of 16 bytes, so nothing in it can be aligned to more.
constexpr std::size_t kAlignmentMax = 16;

constexpr std::uint32_t kMethodIdMax = 65535;
constexpr std::uint32_t kDeadlineMax_us = 3'600'000'000;  // An hour.

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
    }
  }

  void check_misplaced(const OtherAttribute& other) {
    if (!other.use.name.starts_with("rtpm_")) return;
    if (!is_known_attribute(other.use.name)) {
      report(other.use.at, "unknown attribute `" + other.use.name + "`",
             unknown_attribute_hint(other.use.name));
      return;
    }
    const auto known = std::find_if(kKnownAttributes.begin(), kKnownAttributes.end(),
                                    [&](const auto& k) { return k.name == other.use.name; });
    report(other.use.at, "`" + other.use.name + "` has no effect on " + other.owner,
           "it belongs on " + std::string(known->place) + "; remove it here");
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
      check_no_effect(use, "a service", "it belongs on its methods, one by one");
    }
    const std::string of_service = " of service `" + service.name + "`";
    for (std::size_t i = 0; i < service.methods.size(); ++i) {
      check_method(service, i, outline.methods[i], of_service);
    }
    check_clashes(service, outline);
  }

  void check_no_effect(const AttributeUse& use, const std::string& place, const std::string& hint) {
    if (use.name.starts_with("rtpm_") || is_flatbuffers_attribute(use.name)) {
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
                 std::to_string(free_id(service)) + ")");
    }
    check_payload(method.request, outline.request_at, "request", outline.request);
    check_payload(method.reply, outline.reply_at, "reply", outline.reply);
  }

  void check_attribute(Method& method, const AttributeUse& use) {
    if (use.name == "rtpm_id") {
      if (const auto id = number_of(use, kMethodIdMax)) method.id = static_cast<std::uint16_t>(*id);
    } else if (use.name == "rtpm_deadline_us") {
      if (const auto us = number_of(use, kDeadlineMax_us)) {
        method.deadline_us = static_cast<std::uint32_t>(*us);
      }
    } else if (use.name == "rtpm_idempotent") {
      method.is_idempotent = true;
      if (use.value) {
        report(use.value_at, "`rtpm_idempotent` takes no value",
               "write rtpm_idempotent alone, or leave it out");
      }
    } else if (use.name.starts_with("rtpm_")) {
      report(use.at, "unknown attribute `" + use.name + "`", unknown_attribute_hint(use.name));
    } else {
      const bool has_counterpart = is_known_attribute("rtpm_" + use.name);
      check_no_effect(use, "a method",
                      has_counterpart ? "did you mean `rtpm_" + use.name + "`?" : "remove it");
    }
  }

  /// The attribute's number from 1 to `max`; reports what is none.
  std::optional<std::uint64_t> number_of(const AttributeUse& use, std::uint32_t max) {
    const std::string range = "a whole number from 1 to " + std::to_string(max);
    if (!use.value) {
      report(use.at, "`" + use.name + "` needs a value",
             "write (" + use.name + ": N) with " + range);
      return std::nullopt;
    }
    const std::optional<std::uint64_t> value = to_number(*use.value);
    if (value && *value >= 1 && *value <= max) return value;
    report(use.value_at, "`" + use.name + "` is " + range + ", not `" + *use.value + "`",
           "write it in decimal digits, such as " + use.name + ": 1");
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
             "wrap it: `table " + type + "Message { value:" + type +
                 " (required); }`; on the wire that is the bare struct, so it costs nothing");
      return;
    }
    std::set<std::size_t> seen;
    if (const Object* aligned = find_overaligned(payload.table, seen)) {
      report(span,
             "`" + aligned->name + "`, which is part of this " + role + ", is aligned to " +
                 std::to_string(aligned->alignment) + " bytes",
             "a payload begins at a multiple of 16 bytes: lower its force_align to at most 16");
    }
  }

  /// A struct aligned to more than a payload is, among all that is reached from `index`.
  const Object* find_overaligned(std::size_t index, std::set<std::size_t>& seen) const {
    std::vector<std::size_t> open{index};
    while (!open.empty()) {
      const Object& object = model_.objects[open.back()];
      if (!seen.insert(open.back()).second) {
        open.pop_back();
        continue;
      }
      open.pop_back();
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
};

}  // namespace

Diagnostics check(Model& model, const SourceFile& source, const Outline& text) {
  return Checker(model, source, text).check();
}

}  // namespace rtpm::schema
