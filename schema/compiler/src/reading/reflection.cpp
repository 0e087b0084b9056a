#include "reading/reflection.hpp"

#include <flatbuffers/reflection_generated.h>

#include <algorithm>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "reading/flat_arrays.hpp"

namespace rtpm::schema {
namespace {

// The model numbers types like the reflection, so a cast converts them.
static_assert(static_cast<int>(BaseType::kUnionType) == reflection::UType);
static_assert(static_cast<int>(BaseType::kUint64) == reflection::ULong);
static_assert(static_cast<int>(BaseType::kDouble) == reflection::Double);
static_assert(static_cast<int>(BaseType::kObject) == reflection::Obj);
static_assert(static_cast<int>(BaseType::kArray) == reflection::Array);

std::string to_text(const flatbuffers::String* text) {
  return text ? text->str() : std::string{};
}

Documentation read_documentation(
    const flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>* lines) {
  Documentation documentation;
  if (lines == nullptr) return documentation;
  for (const auto* line : *lines)
    documentation.push_back(line->str());
  return documentation;
}

std::vector<Attribute> read_attributes(
    const flatbuffers::Vector<flatbuffers::Offset<reflection::KeyValue>>* pairs) {
  std::vector<Attribute> attributes;
  if (pairs == nullptr) return attributes;
  for (const auto* pair : *pairs)
    attributes.push_back({to_text(pair->key()), to_text(pair->value())});
  return attributes;
}

/// Reads the type in `slot` as a number: in untrusted bytes it may be outside the enumeration, for
/// which the reflection's own accessor has undefined behaviour.
BaseType read_base_type(const reflection::Type& type, flatbuffers::voffset_t slot) {
  const auto* table = reinterpret_cast<const flatbuffers::Table*>(&type);
  const auto number = table->GetField<std::uint8_t>(slot, reflection::None);
  // A vector with a 64-bit size, since 23.5.26. AttributeReader refuses its attribute.
  constexpr std::uint8_t kVector64 = 18;
  return number == kVector64 ? BaseType::kVector : static_cast<BaseType>(number);
}

Type read_type(const reflection::Type* type) {
  if (type == nullptr) return {};
  Type result{.base = read_base_type(*type, reflection::Type::VT_BASE_TYPE),
              .element = read_base_type(*type, reflection::Type::VT_ELEMENT),
              .index = std::nullopt,
              .fixed_length = type->fixed_length()};
  if (type->index() >= 0) result.index = static_cast<std::size_t>(type->index());
  return result;
}

Field read_field(const reflection::Field& field) {
  return {.name = to_text(field.name()),
          .type = read_type(field.type()),
          .id = field.id(),
          .offset = field.offset(),
          .default_integer = field.default_integer(),
          .default_real = field.default_real(),
          .is_required = field.required(),
          .is_optional = field.optional(),
          .is_deprecated = field.deprecated(),
          .is_key = field.key(),
          .unit = {},
          .frame = {},
          .range = {},
          .attributes = read_attributes(field.attributes()),
          .documentation = read_documentation(field.documentation()),
          .location = {}};
}

Object read_object(const reflection::Object& object) {
  Object result{.name = to_text(object.name()),
                .is_struct = object.is_struct(),
                .alignment = static_cast<std::size_t>(std::max(object.minalign(), 1)),
                .byte_size = static_cast<std::size_t>(std::max(object.bytesize(), 0)),
                .fields = {},
                .event_id = {},
                .event_fingerprint = 0,
                .attributes = read_attributes(object.attributes()),
                .documentation = read_documentation(object.documentation()),
                .declaration_file = to_text(object.declaration_file()),
                .location = {}};
  for (const auto* field : *object.fields()) {
    result.fields.push_back(read_field(*field));
    // 2.0.8 marks an array of structs as optional, but a struct's fields are always present.
    result.fields.back().is_optional &= !result.is_struct;
  }
  // The reflection sorts fields by name.
  std::sort(result.fields.begin(), result.fields.end(),
            [](const Field& a, const Field& b) { return a.id < b.id; });
  return result;
}

bool has_attribute(const reflection::Enum& enumeration, std::string_view name) {
  const std::vector<Attribute> attributes = read_attributes(enumeration.attributes());
  return std::ranges::any_of(attributes, [&](const Attribute& each) { return each.name == name; });
}

Enum read_enum(const reflection::Enum& enumeration) {
  Enum result{.name = to_text(enumeration.name()),
              .is_union = enumeration.is_union(),
              .is_bit_flags = has_attribute(enumeration, "bit_flags"),
              .underlying = read_type(enumeration.underlying_type()).base,
              .values = {},
              .documentation = read_documentation(enumeration.documentation()),
              .declaration_file = to_text(enumeration.declaration_file()),
              .location = {}};
  for (const auto* value : *enumeration.values()) {
    result.values.push_back({.name = to_text(value->name()),
                             .value = value->value(),
                             .union_type = read_type(value->union_type()),
                             .documentation = read_documentation(value->documentation()),
                             .location = {}});
  }
  return result;
}

/// Finds tables by name, for the requests and replies of methods.
using ObjectIndex = std::unordered_map<std::string, std::size_t>;

/// @errors nullopt: a method's request or reply is not among `objects`
std::optional<Service> read_service(const reflection::Service& service,
                                    const ObjectIndex& objects) {
  Service result{.name = to_text(service.name()),
                 .fingerprint = 0,
                 .methods = {},
                 .priority_model = {},
                 .priority = {},
                 .attributes = read_attributes(service.attributes()),
                 .documentation = read_documentation(service.documentation()),
                 .location = {}};
  if (service.calls() == nullptr) return result;
  for (const auto* call : *service.calls()) {
    const auto request = objects.find(to_text(call->request()->name()));
    const auto reply = objects.find(to_text(call->response()->name()));
    if (request == objects.end() || reply == objects.end()) return std::nullopt;
    Method method;
    method.name = to_text(call->name());
    method.request.table = request->second;
    method.reply.table = reply->second;
    method.attributes = read_attributes(call->attributes());
    method.documentation = read_documentation(call->documentation());
    result.methods.push_back(std::move(method));
  }
  return result;
}

bool is_valid(const Type& type, const Model& model) {
  if (type.base > BaseType::kArray || type.element > BaseType::kArray) return false;
  if (!type.is_many() && type.element != BaseType::kNone) return false;
  if (!type.index) return !type.has_object();
  return *type.index < (type.has_object() ? model.objects.size() : model.enums.size());
}

/// Whether all types are valid and refer to existing ones, which later code relies on.
bool is_closed(const Model& model) {
  for (const Object& object : model.objects) {
    for (const Field& field : object.fields) {
      if (!is_valid(field.type, model)) return false;
    }
  }
  for (const Enum& enumeration : model.enums) {
    for (const EnumValue& value : enumeration.values) {
      if (!is_valid(value.union_type, model)) return false;
    }
  }
  return true;
}

/// The file from which a .bfbs was most likely compiled; flatc does not record it.
std::string main_file(const reflection::Schema& schema) {
  if (schema.services() != nullptr && schema.services()->size() != 0) {
    return to_text(schema.services()->Get(0)->declaration_file());
  }
  return schema.objects()->size() == 0 ? std::string{}
                                       : to_text(schema.objects()->Get(0)->declaration_file());
}

/// @param declaration_file  if nullptr, takes all services, and uses main_file() as the compiled
///           file
std::optional<Model> read_schema(std::span<const std::uint8_t> bytes,
                                 const std::string* declaration_file) {
  // A generous limit, because a type is visited once for every method that uses it.
  flatbuffers::Verifier verifier(bytes.data(), bytes.size(), /*max_depth=*/64,
                                 /*max_tables=*/1'000'000'000);
  if (!reflection::VerifySchemaBuffer(verifier)) return std::nullopt;
  const reflection::Schema& schema = *reflection::GetSchema(bytes.data());
  Model model;
  model.feature_bits = static_cast<std::uint64_t>(schema.advanced_features());
  model.declaration_file = declaration_file ? *declaration_file : main_file(schema);
  ObjectIndex objects;
  for (const auto* object : *schema.objects()) {
    objects.emplace(to_text(object->name()), model.objects.size());
    model.objects.push_back(read_object(*object));
  }
  for (const auto* enumeration : *schema.enums())
    model.enums.push_back(read_enum(*enumeration));
  if (!is_closed(model)) return std::nullopt;
  if (schema.services() == nullptr) return model;
  for (const auto* service : *schema.services()) {
    if (declaration_file && to_text(service->declaration_file()) != *declaration_file) continue;
    std::optional<Service> result = read_service(*service, objects);
    if (!result) return std::nullopt;
    for (Method& method : result->methods) {
      method.request = payload_of(model, method.request.table);
      method.reply = payload_of(model, method.reply.table);
    }
    model.services.push_back(std::move(*result));
  }
  return model;
}

}  // namespace

std::optional<Model> read_reflection(std::span<const std::uint8_t> bytes,
                                     const std::string& declaration_file) {
  return read_schema(bytes, &declaration_file);
}

std::optional<Model> read_reflection(std::span<const std::uint8_t> bytes) {
  std::optional<Model> model = read_schema(bytes, nullptr);
  if (model) restore_arrays(*model);
  return model;
}

}  // namespace rtpm::schema
