#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "model/spelling.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/fingerprint.hpp"
#include "text/json_writer.hpp"

// The form is described in schema/model.md; a change that a reader would misread raises the
// version.
namespace rtpm::schema {
namespace {

constexpr int kFormatVersion = 1;

std::string hexadecimal(std::uint64_t value, std::size_t digits) {
  std::string text(digits, '0');
  for (auto digit = text.rbegin(); digit != text.rend(); ++digit, value >>= 4) {
    *digit = "0123456789abcdef"[value & 0xF];
  }
  return "0x" + text;
}

class ModelWriter {
 public:
  ModelWriter(const Model& model, std::string_view compiler_version)
      : model_(model), version_(compiler_version) {}

  std::string write() {
    json_.object()
        .text("format", "rtpm-model")
        .number("format_version", std::int64_t{kFormatVersion});
    json_.text("compiler_version", version_).text("file", file_name(model_.file));
    json_.array("services");
    for (const Service& service : model_.services)
      write_service(service);
    json_.end().array("objects");
    for (const Object& object : model_.objects)
      write_object(object);
    json_.end().array("enums");
    for (const Enum& enumeration : model_.enums)
      write_enum(enumeration);
    json_.end().end();
    return json_.take();
  }

 private:
  static std::string file_name(const std::string& path) {
    return std::filesystem::path(path).filename().string();
  }

  void write_documentation(const Documentation& lines) {
    if (lines.empty()) return;
    json_.array("documentation");
    for (const std::string& line : lines)
      json_.text({}, line);
    json_.end();
  }

  /// All of them, RTPM's own and FlatBuffers' too, as they are in the schema.
  void write_attributes(const std::vector<Attribute>& attributes) {
    if (attributes.empty()) return;
    json_.object("attributes");
    for (const Attribute& attribute : attributes)
      json_.text(attribute.name, attribute.value);
    json_.end();
  }

  void write_service(const Service& service) {
    json_.object().text("name", service.name);
    json_.text("fingerprint", hexadecimal(service.fingerprint, 16));
    json_.text("text", interface_text(model_, service));
    json_.text("priority_model", spelling_of(service.priority_model));
    if (service.priority) json_.number("priority", std::int64_t{*service.priority});
    write_documentation(service.documentation);
    write_attributes(service.attributes);
    json_.array("methods");
    for (const Method& method : service.methods)
      write_method(method);
    json_.end().end();
  }

  void write_method(const Method& method) {
    json_.object().text("name", method.name).number("id", std::int64_t{method.id});
    json_.text("fingerprint", hexadecimal(method.fingerprint, 8));
    write_payload("request", method.request);
    write_payload("reply", method.reply);
    json_.boolean("is_idempotent", method.is_idempotent);
    if (method.deadline_us) json_.number("deadline_us", std::int64_t{*method.deadline_us});
    if (method.oneway) json_.text("oneway", spelling_of(*method.oneway));
    json_.boolean("is_deferred", method.is_deferred).boolean("is_stream", method.is_stream);
    if (method.max_size) json_.number("max_size", std::int64_t{*method.max_size});
    write_documentation(method.documentation);
    write_attributes(method.attributes);
    json_.end();
  }

  void write_payload(std::string_view role, const Payload& payload) {
    json_.object(role).text("kind", spelling_of(payload.kind));
    json_.text("table", model_.objects[payload.table].name);
    if (payload.struct_index) json_.text("struct", model_.objects[*payload.struct_index].name);
    json_.end();
  }

  void write_type(std::string_view name, const Type& type) {
    json_.object(name).text("base", spelling_of(type.base));
    const bool is_many = type.base == BaseType::kVector || type.base == BaseType::kArray;
    if (is_many) json_.text("element", spelling_of(type.element));
    if (type.base == BaseType::kArray) json_.number("length", std::int64_t{type.fixed_length});
    if (type.index) {
      const bool is_object = type.base == BaseType::kObject || type.element == BaseType::kObject;
      json_.text(is_object ? "object" : "enum",
                 is_object ? model_.objects[*type.index].name : model_.enums[*type.index].name);
    }
    json_.end();
  }

  void write_object(const Object& object) {
    json_.object().text("name", object.name).text("kind", object.is_struct ? "struct" : "table");
    json_.text("file", file_name(object.declaration_file));
    if (object.is_struct) {
      json_.number("byte_size", static_cast<std::int64_t>(object.byte_size));
      json_.number("alignment", static_cast<std::int64_t>(object.alignment));
    }
    if (object.event_id) {
      json_.object("event").number("id", std::int64_t{*object.event_id});
      json_.text("fingerprint", hexadecimal(object.event_fingerprint, 16)).end();
    }
    write_documentation(object.documentation);
    write_attributes(object.attributes);
    json_.array("fields");
    for (const Field& field : object.fields)
      write_field(object, field);
    json_.end().end();
  }

  void write_field(const Object& object, const Field& field) {
    json_.object().text("name", field.name);
    json_.number(object.is_struct ? "offset" : "id",
                 std::int64_t{object.is_struct ? field.offset : field.id});
    write_type("type", field.type);
    const BaseType base = field.type.base;
    if (!object.is_struct && base <= BaseType::kDouble && !field.is_optional) {
      if (base == BaseType::kFloat || base == BaseType::kDouble) {
        json_.number("default", field.default_real);
      } else {
        json_.number("default", field.default_integer);
      }
    }
    if (field.is_required) json_.boolean("is_required", true);
    if (field.is_optional) json_.boolean("is_optional", true);
    if (field.is_deprecated) json_.boolean("is_deprecated", true);
    if (field.is_key) json_.boolean("is_key", true);
    if (!field.unit.empty()) json_.text("unit", field.unit);
    if (!field.frame.empty()) json_.text("frame", field.frame);
    if (field.range) {
      json_.object("range").number("low", field.range->low).number("high", field.range->high).end();
    }
    write_documentation(field.documentation);
    write_attributes(field.attributes);
    json_.end();
  }

  void write_enum(const Enum& enumeration) {
    json_.object().text("name", enumeration.name);
    json_.text("kind", enumeration.is_union ? "union" : "enum");
    json_.text("file", file_name(enumeration.declaration_file));
    json_.text("underlying", spelling_of(enumeration.underlying));
    write_documentation(enumeration.documentation);
    json_.array("values");
    for (const EnumValue& value : enumeration.values) {
      json_.object().text("name", value.name).number("value", value.value);
      if (enumeration.is_union) write_type("type", value.union_type);
      write_documentation(value.documentation);
      json_.end();
    }
    json_.end().end();
  }

  const Model& model_;
  std::string_view version_;
  JsonWriter json_{};
};

class JsonBackEnd final : public BackEnd {
 public:
  explicit JsonBackEnd(std::string compiler_version) : version_(std::move(compiler_version)) {}

  [[nodiscard]] Diagnostics check(const Model&) const override { return {}; }

  [[nodiscard]] std::vector<GeneratedFile> generate(const Model& model) const override {
    return {{model.file_stem + ".rtpm.json", ModelWriter(model, version_).write()}};
  }

 private:
  std::string version_;
};

}  // namespace

std::unique_ptr<BackEnd> make_json_back_end(std::string compiler_version) {
  return std::make_unique<JsonBackEnd>(std::move(compiler_version));
}

}  // namespace rtpm::schema
