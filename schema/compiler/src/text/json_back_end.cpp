#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "model/spelling.hpp"
#include "model/words.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/fingerprint.hpp"

// schema/model.md describes the format; a change that readers would misread requires a new version.
namespace rtpm::schema {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kFormatVersion = 1;

/// JSON has no infinity and no NaN, so they are written as text, as in FlatBuffers.
Json number_of(double value) {
  return std::isfinite(value) ? Json(value) : Json(number_text(value));
}

std::string file_name(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

template <class List, class Make>
Json list_of(const List& list, Make make) {
  Json values = Json::array();
  for (const auto& each : list)
    values.push_back(make(each));
  return values;
}

class ModelWriter {
 public:
  explicit ModelWriter(const Model& model) : model_(model) {}

  std::string write(const std::string& compiler_version) const {
    const auto made_by = [this](auto member) {
      return [this, member](const auto& each) { return (this->*member)(each); };
    };
    const Json root{{"format", "rtpm-model"},
                    {"format_version", kFormatVersion},
                    {"compiler_version", compiler_version},
                    {"file", file_name(model_.file)},
                    {"services", list_of(model_.services, made_by(&ModelWriter::service_json))},
                    {"objects", list_of(model_.objects, made_by(&ModelWriter::object_json))},
                    {"enums", list_of(model_.enums, made_by(&ModelWriter::enum_json))}};
    return root.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
  }

 private:
  /// Adds all attributes as written in the schema, including RTPM's own and FlatBuffers'.
  static void add_notes(Json& json, const Documentation& lines,
                        const std::vector<Attribute>& attributes = {}) {
    if (!lines.empty()) json["documentation"] = lines;
    for (const Attribute& attribute : attributes)
      json["attributes"][attribute.name] = attribute.value;
  }

  Json service_json(const Service& service) const {
    Json json{{"name", service.name},
              {"fingerprint", hexadecimal(service.fingerprint, 16)},
              {"text", interface_text(model_, service)},
              {"priority_model", spelling_of(service.priority_model)}};
    if (service.priority) json["priority"] = *service.priority;
    add_notes(json, service.documentation, service.attributes);
    json["methods"] =
        list_of(service.methods, [this](const Method& method) { return method_json(method); });
    return json;
  }

  Json method_json(const Method& method) const {
    Json json{{"name", method.name},
              {"id", method.id},
              {"fingerprint", hexadecimal(method.fingerprint, 8)},
              {"request", payload_json(method.request)},
              {"reply", payload_json(method.reply)},
              {"is_idempotent", method.is_idempotent},
              {"role", spelling_of(method.role)}};
    if (method.deadline_us) json["deadline_us"] = *method.deadline_us;
    if (method.oneway) json["oneway"] = spelling_of(*method.oneway);
    json["is_deferred"] = method.is_deferred;
    json["is_stream"] = method.is_stream;
    if (method.max_size) json["max_size"] = *method.max_size;
    add_notes(json, method.documentation, method.attributes);
    return json;
  }

  Json payload_json(const Payload& payload) const {
    Json json{{"kind", spelling_of(payload.kind)}, {"table", model_.objects[payload.table].name}};
    if (payload.struct_index) json["struct"] = model_.objects[*payload.struct_index].name;
    return json;
  }

  Json type_json(const Type& type) const {
    Json json{{"base", spelling_of(type.base)}};
    if (type.is_many()) json["element"] = spelling_of(type.element);
    if (type.base == BaseType::kArray) json["length"] = type.fixed_length;
    if (type.index) json[type.has_object() ? "object" : "enum"] = referred_name(model_, type);
    return json;
  }

  Json object_json(const Object& object) const {
    Json json{{"name", object.name},
              {"kind", object.is_struct ? "struct" : "table"},
              {"file", file_name(object.declaration_file)}};
    if (object.is_struct) {
      json["byte_size"] = object.byte_size;
      json["alignment"] = object.alignment;
    }
    if (object.event_id) {
      json["event"] = {{"id", *object.event_id},
                       {"fingerprint", hexadecimal(object.event_fingerprint, 16)}};
    }
    add_notes(json, object.documentation, object.attributes);
    json["fields"] =
        list_of(object.fields, [&](const Field& field) { return field_json(object, field); });
    return json;
  }

  Json field_json(const Object& object, const Field& field) const {
    Json json{{"name", field.name}};
    json[object.is_struct ? "offset" : "id"] = object.is_struct ? field.offset : field.id;
    json["type"] = type_json(field.type);
    const BaseType base = field.type.base;
    if (!object.is_struct && base <= BaseType::kDouble && !field.is_optional) {
      const bool is_real = base == BaseType::kFloat || base == BaseType::kDouble;
      json["default"] = is_real ? number_of(field.default_real) : Json(field.default_integer);
      if (base == BaseType::kUint64) {
        json["default"] = static_cast<std::uint64_t>(field.default_integer);
      }
    }
    if (field.is_required) json["is_required"] = true;
    if (field.is_optional) json["is_optional"] = true;
    if (field.is_deprecated) json["is_deprecated"] = true;
    if (field.is_key) json["is_key"] = true;
    if (!field.unit.empty()) json["unit"] = field.unit;
    if (!field.frame.empty()) json["frame"] = field.frame;
    if (field.range) {
      json["range"] = {{"low", number_of(field.range->low)},
                       {"high", number_of(field.range->high)}};
    }
    add_notes(json, field.documentation, field.attributes);
    return json;
  }

  Json enum_json(const Enum& enumeration) const {
    Json json{{"name", enumeration.name},
              {"kind", enumeration.is_union ? "union" : "enum"},
              {"file", file_name(enumeration.declaration_file)},
              {"underlying", spelling_of(enumeration.underlying)}};
    add_notes(json, enumeration.documentation);
    json["values"] = list_of(enumeration.values, [&](const EnumValue& value) {
      Json entry{{"name", value.name}, {"value", value.value}};
      if (enumeration.is_union) entry["type"] = type_json(value.union_type);
      add_notes(entry, value.documentation);
      return entry;
    });
    return json;
  }

  const Model& model_;
};

class JsonBackEnd final : public BackEnd {
 public:
  explicit JsonBackEnd(std::string compiler_version) : version_(std::move(compiler_version)) {}

  [[nodiscard]] Diagnostics check(const Model&) const override { return {}; }

  [[nodiscard]] std::vector<GeneratedFile> generate(const Model& model) const override {
    return {{model.file_stem + ".rtpm.json", ModelWriter(model).write(version_)}};
  }

 private:
  std::string version_;
};

}  // namespace

std::unique_ptr<BackEnd> make_json_back_end(std::string compiler_version) {
  return std::make_unique<JsonBackEnd>(std::move(compiler_version));
}

}  // namespace rtpm::schema
