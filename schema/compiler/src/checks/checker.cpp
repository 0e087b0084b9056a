#include "checks/checker.hpp"

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "checks/attribute_reader.hpp"
#include "checks/type_checker.hpp"
#include "model/reach.hpp"
#include "model/words.hpp"

namespace rtpm::schema {
namespace {

// The features of FlatBuffers 2.0.8 to 25: fixed arrays, unions of structs, optional scalars,
// default strings and vectors. A schema with other features comes from a newer parser.
constexpr std::uint64_t kKnownFeatureBits = 0xF;

// A payload starts at a multiple of 16 bytes, so no part of it can be aligned to more.
constexpr std::size_t kAlignmentMax = 16;

constexpr std::uint32_t kMethodIdMax = 65535;

class Checker {
 public:
  Checker(Model& model, const SchemaText& text, Diagnostics& errors)
      : model_(model), text_(text), reader_(text, errors), errors_(errors) {}

  void check() {
    check_features();
    for (const NamespaceOutline& name : text_.outline().namespaces) {
      model_.namespaces.push_back({name.name, text_.locate(name.at)});
    }
    sort_services();
    for (std::size_t i = 0; i < model_.services.size(); ++i) {
      check_service(model_.services[i], text_.outline().services[i]);
    }
  }

 private:
  void report(Span span, std::string message, std::string hint) const {
    reader_.report(span, std::move(message), std::move(hint));
  }

  void check_features() {
    const std::uint64_t unknown = model_.feature_bits & ~kKnownFeatureBits;
    if (unknown == 0) return;
    errors_.push_back(
        {Location{.file = model_.file},
         "the schema uses features of FlatBuffers that this rtpmc does not know (bits " +
             std::to_string(unknown) + ")",
         "use a newer rtpmc, or do without the feature", std::nullopt});
  }

  /// Restores the order in the text, because the reflection sorts by name.
  void sort_services() {
    std::map<std::string, std::size_t> places;
    for (std::size_t i = 0; i < text_.outline().services.size(); ++i)
      places.emplace(text_.outline().services[i].name, i);
    std::sort(model_.services.begin(), model_.services.end(),
              [&](const Service& a, const Service& b) { return places[a.name] < places[b.name]; });
  }

  void check_service(Service& service, const ServiceOutline& outline) {
    service.location = text_.locate(outline.at);
    check_service_attributes(service, outline);
    largest_id_ = largest_id(service);
    missing_id_count_ = 0;
    const std::string of_service = " of service `" + service.name + "`";
    for (std::size_t i = 0; i < service.methods.size(); ++i) {
      check_method(service, i, outline.methods[i], of_service);
    }
    check_clashes(service, outline);
  }

  void check_service_attributes(Service& service, const ServiceOutline& outline) {
    std::set<std::string> seen;
    const AttributeUse* model_use = nullptr;
    for (const AttributeUse& use : outline.attributes) {
      if (!reader_.is_first(use, seen)) continue;
      const auto value = reader_.read(use, AttributePlace::kService, "a service");
      if (!value) continue;
      if (use.name == "rtpm_priority") {
        service.priority = static_cast<std::uint16_t>(value->number);
      } else {
        service.priority_model = static_cast<PriorityModel>(value->number);
        model_use = &use;
      }
    }
    if (service.priority_model == PriorityModel::kServerDeclared &&
        !seen.contains("rtpm_priority")) {
      report(model_use->at,
             "service `" + service.name + "` is server_declared and has no rtpm_priority",
             "write it: (rtpm_priority_model: \"server_declared\", rtpm_priority: 16000)");
    }
  }

  void check_method(Service& service, std::size_t index, const MethodOutline& outline,
                    const std::string& of_service) {
    Method& method = service.methods[index];
    method.location = text_.locate(outline.at);
    std::set<std::string> seen;
    std::map<std::string, const AttributeUse*> uses;
    for (const AttributeUse& use : outline.attributes) {
      if (!reader_.is_first(use, seen)) continue;
      const auto value = reader_.read(use, AttributePlace::kMethod, "a method");
      if (!value) continue;
      uses.emplace(use.name, &use);
      set_attribute(method, use.name, *value);
    }
    if (!seen.contains("rtpm_id")) {
      report(outline.at, "method `" + method.name + "`" + of_service + " has no rtpm_id",
             "give it a number that no method of the service ever had: (rtpm_id: " +
                 std::to_string(largest_id_ + 1 + missing_id_count_++) + ")");
    }
    check_payload(method.request, outline.request_at, "request", outline.request);
    check_payload(method.reply, outline.reply_at, "reply", outline.reply);
    check_manner(method, outline, uses);
  }

  static void set_attribute(Method& method, const std::string& name,
                            const AttributeReader::Value& value) {
    if (name == "rtpm_id") method.id = static_cast<std::uint16_t>(value.number);
    if (name == "rtpm_deadline_us") method.deadline_us = static_cast<std::uint32_t>(value.number);
    if (name == "rtpm_idempotent") method.is_idempotent = true;
    if (name == "rtpm_oneway") method.oneway = static_cast<OnewayLevel>(value.number);
    if (name == "rtpm_role") method.role = static_cast<Role>(value.number);
    if (name == "rtpm_deferred") method.is_deferred = true;
    if (name == "rtpm_stream") method.is_stream = true;
    if (name == "rtpm_max_size") method.max_size = static_cast<std::uint32_t>(value.number);
  }

  /// Checks the rules between oneway, deferred, stream, the maximum size and the payloads.
  void check_manner(const Method& method, const MethodOutline& outline,
                    const std::map<std::string, const AttributeUse*>& uses) const {
    const bool has_reply = method.reply.kind != PayloadKind::kEmpty;
    if (method.oneway && (method.is_stream || method.is_deferred)) {
      const char* other = method.is_stream ? "rtpm_stream" : "rtpm_deferred";
      report(uses.at(other)->at,
             "method `" + method.name + "` is oneway, so it cannot have `" + other + "`",
             "a oneway method has no reply to defer or to stream: remove one of the two");
    } else if (method.oneway && has_reply) {
      report(outline.reply_at,
             "oneway method `" + method.name + "` has the reply `" + outline.reply +
                 "`, which is never sent",
             "write rtpm.Empty as its reply, or remove `rtpm_oneway`");
    } else if (method.is_stream && method.is_deferred) {
      report(uses.at("rtpm_deferred")->at, "`rtpm_deferred` has no effect on a stream",
             "a stream's items may be written at any time: remove it");
    } else if (method.is_stream && !has_reply) {
      report(outline.reply_at, "the items of stream `" + method.name + "` have no content",
             "the reply's type is the item's: write a table");
    }
    const bool has_table =
        method.request.kind == PayloadKind::kTable || method.reply.kind == PayloadKind::kTable;
    if (method.max_size && !has_table) {
      reader_.report_no_effect(*uses.at("rtpm_max_size"), "method `" + method.name + "`",
                               "its request and reply have fixed sizes: remove it");
    }
  }

  /// The largest valid id among the service's methods.
  [[nodiscard]] static std::uint32_t largest_id(const Service& service) {
    std::uint64_t largest = 0;
    for (const Method& method : service.methods) {
      for (const Attribute& attribute : method.attributes) {
        if (attribute.name != "rtpm_id") continue;
        const std::uint64_t value = to_number(attribute.value).value_or(0);
        if (value < kMethodIdMax) largest = std::max(largest, value);
      }
    }
    return static_cast<std::uint32_t>(largest);
  }

  void check_clashes(const Service& service, const ServiceOutline& outline) {
    std::map<std::uint16_t, std::size_t> first_with_id;
    for (std::size_t i = 0; i < service.methods.size(); ++i) {
      if (service.methods[i].id == 0) continue;
      const auto [first, is_new] = first_with_id.emplace(service.methods[i].id, i);
      if (is_new) continue;
      errors_.push_back(
          {text_.locate(id_span(outline.methods[i])),
           "methods `" + service.methods[first->second].name + "` and `" + service.methods[i].name +
               "` of service `" + service.name + "` have the same rtpm_id " +
               std::to_string(service.methods[i].id),
           "the next free number is " + std::to_string(largest_id_ + 1),
           Note{text_.locate(id_span(outline.methods[first->second])), "it is used here first"}});
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
    // FlatBuffers' parser reports this itself, unless the struct is defined after the service.
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

  /// A struct reachable from a payload whose alignment exceeds the payload's.
  [[nodiscard]] const Object* find_overaligned(std::size_t index) const {
    if (!has_overaligned_) return nullptr;
    Reach reach;
    reach.add(model_, index);
    for (const std::size_t reached : reach.objects) {
      if (is_overaligned(model_.objects[reached])) return &model_.objects[reached];
    }
    return nullptr;
  }

  [[nodiscard]] static bool is_overaligned(const Object& object) {
    return object.alignment > kAlignmentMax;
  }

  Model& model_;
  const SchemaText& text_;
  AttributeReader reader_;
  Diagnostics& errors_;
  const bool has_overaligned_ = std::ranges::any_of(model_.objects, is_overaligned);
  std::uint32_t largest_id_ = 0;        // The largest id in the current service.
  std::uint32_t missing_id_count_ = 0;  // Methods without an id so far; numbers the hints.
};

}  // namespace

Diagnostics check(Model& model, const std::deque<SchemaText>& texts) {
  Diagnostics errors;
  check_types(model, texts, errors);
  Checker(model, texts.front(), errors).check();
  return errors;
}

}  // namespace rtpm::schema
