#include "rtpm/schema/fingerprint.hpp"

#include <algorithm>
#include <functional>
#include <string_view>
#include <vector>

#include "model/reach.hpp"
#include "model/spelling.hpp"
#include "model/words.hpp"

namespace rtpm::schema {
namespace {

/// FNV-1a, 64 bits.
/// @source Fowler, Noll, Vo
std::uint64_t hash(std::string_view text) noexcept {
  std::uint64_t value = 0xcbf29ce484222325ULL;
  for (const char character : text) {
    value ^= static_cast<std::uint8_t>(character);
    value *= 0x100000001b3ULL;
  }
  return value;
}

/// Whether a FlatBuffers attribute changes the meaning of bytes.
bool matters(const Attribute& attribute) noexcept {
  return attribute.name == "nested_flatbuffer" || attribute.name == "flexbuffer" ||
         attribute.name == "force_align";
}

/// Writes the types reached from methods, each only once, by name.
class TypeWriter {
 public:
  explicit TypeWriter(const Model& model) : model_(model) {}

  void reach_object(std::size_t index) { reach_.add(model_, index); }

  [[nodiscard]] std::string text() const {
    std::vector<std::string> texts;
    for (const std::size_t index : reach_.objects)
      texts.push_back(text_of(model_.objects[index]));
    for (const std::size_t index : reach_.enums)
      texts.push_back(text_of(model_.enums[index]));
    std::sort(texts.begin(), texts.end());
    std::string all;
    for (const std::string& text : texts)
      all += text;
    return all;
  }

 private:
  [[nodiscard]] std::string text_of(const Type& type) const {
    std::string text(spelling_of(type.base));
    if (type.is_many()) {
      text += '<' + std::string(spelling_of(type.element)) + '>';
    }
    if (type.base == BaseType::kArray) text += ':' + std::to_string(type.fixed_length);
    return type.index ? text + ' ' + referred_name(model_, type) : text;
  }

  [[nodiscard]] std::string text_of(const Object& object) const {
    std::string text = object.is_struct
                           ? "struct " + object.name + " size " + std::to_string(object.byte_size) +
                                 " align " + std::to_string(object.alignment)
                           : "table " + object.name;
    text += " {\n";
    for (const Field& field : object.fields) {
      text += "  " + std::to_string(object.is_struct ? field.offset : field.id) + ' ' + field.name +
              ": " + text_of(field.type);
      if (!object.is_struct) text += rules_of(field);
      if (!field.unit.empty()) text += " in \"" + field.unit + '"';
      if (!field.frame.empty()) text += " frame \"" + field.frame + '"';
      text += '\n';
    }
    return text + "}\n";
  }

  [[nodiscard]] static std::string rules_of(const Field& field) {
    std::string text;
    if (field.is_required) text += " required";
    if (field.is_optional) text += " optional";
    if (field.is_deprecated) text += " deprecated";
    if (field.is_key) text += " key";
    if (field.type.base == BaseType::kFloat || field.type.base == BaseType::kDouble) {
      text += " = " + number_text(field.default_real);
    } else if (field.type.base < BaseType::kFloat) {
      text += " = " + (field.type.base == BaseType::kUint64
                           ? std::to_string(static_cast<std::uint64_t>(field.default_integer))
                           : std::to_string(field.default_integer));
    }
    for (const Attribute& attribute : field.attributes) {
      if (matters(attribute)) text += ' ' + attribute.name + ':' + attribute.value;
    }
    return text;
  }

  [[nodiscard]] std::string text_of(const Enum& enumeration) const {
    std::string text = (enumeration.is_union ? "union " : "enum ") + enumeration.name + ' ' +
                       std::string(spelling_of(enumeration.underlying)) + " {\n";
    for (const EnumValue& value : enumeration.values) {
      text += "  " + value.name + " = " + std::to_string(value.value);
      if (enumeration.is_union) text += ": " + text_of(value.union_type);
      text += '\n';
    }
    return text + "}\n";
  }

  const Model& model_;
  Reach reach_{};
};

std::string manner_of(const Method& method) {
  std::string text;
  if (method.is_idempotent) text += " idempotent";
  if (method.oneway) text += " oneway " + std::string(spelling_of(*method.oneway));
  if (method.is_stream) text += " stream";
  return text;
}

std::string text_of(const Model& model, const Payload& payload) {
  return std::string(spelling_of(payload.kind)) + ' ' + model.objects[payload.table].name;
}

std::string head_of(const Model& model, const Method& method) {
  return "method " + std::to_string(method.id) + ' ' + method.name + manner_of(method) +
         "\nrequest " + text_of(model, method.request) + "\nreply " + text_of(model, method.reply) +
         '\n';
}

std::vector<const Method*> by_id(const Service& service) {
  std::vector<const Method*> methods;
  for (const Method& method : service.methods)
    methods.push_back(&method);
  std::sort(methods.begin(), methods.end(),
            [](const Method* a, const Method* b) { return a->id < b->id; });
  return methods;
}

}  // namespace

std::string canonical_text(const Model& model, const Method& method) {
  TypeWriter types(model);
  types.reach_object(method.request.table);
  types.reach_object(method.reply.table);
  return head_of(model, method) + types.text();
}

std::string canonical_text(const Model& model, const Service& service) {
  std::string text = "service " + service.name + '\n';
  for (const Method* method : by_id(service))
    text += canonical_text(model, *method);
  return text;
}

std::string interface_text(const Model& model, const Service& service) {
  std::string text = "service " + service.name + '\n';
  TypeWriter types(model);
  for (const Method* method : by_id(service)) {
    text += head_of(model, *method);
    types.reach_object(method->request.table);
    types.reach_object(method->reply.table);
  }
  return text + types.text();
}

std::string canonical_text(const Model& model, const Object& event) {
  TypeWriter types(model);
  types.reach_object(static_cast<std::size_t>(&event - model.objects.data()));
  return "event " + std::to_string(event.event_id.value_or(0)) + ' ' + event.name + '\n' +
         types.text();
}

void set_fingerprints(Model& model) {
  for (Object& object : model.objects) {
    if (object.event_id) object.event_fingerprint = hash(canonical_text(model, object));
  }
  for (Service& service : model.services) {
    service.fingerprint = hash(canonical_text(model, service));
    for (Method& method : service.methods) {
      const std::uint64_t value = hash(canonical_text(model, method));
      method.fingerprint = static_cast<std::uint32_t>(value ^ (value >> 32));
    }
  }
}

}  // namespace rtpm::schema
