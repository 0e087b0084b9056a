#include "rtpm/schema/schema_text.hpp"

#include <bit>
#include <set>
#include <string>
#include <vector>

#include "model/attributes.hpp"
#include "model/reach.hpp"
#include "model/spelling.hpp"
#include "model/words.hpp"

namespace rtpm::schema {
namespace {

std::string comment(const Documentation& lines, const std::string& indent) {
  std::string text;
  for (const std::string& line : lines)
    text.append(indent).append("///").append(line).append(1, '\n');
  return text;
}

/// The attributes of one declaration: " (rtpm_id: 1, rtpm_idempotent)".
class AttributeList {
 public:
  AttributeList& flag(bool is_there, const std::string& name) {
    if (is_there) add(name);
    return *this;
  }
  AttributeList& number(bool is_there, const std::string& name, std::uint64_t value) {
    if (is_there) add(name + ": " + std::to_string(value));
    return *this;
  }
  AttributeList& text(const std::string& name, std::string_view value) {
    if (!value.empty()) add(name + ": \"" + std::string(value) + '"');
    return *this;
  }
  [[nodiscard]] std::string str() const { return text_.empty() ? "" : " (" + text_ + ')'; }

 private:
  void add(const std::string& attribute) { text_ += (text_.empty() ? "" : ", ") + attribute; }
  std::string text_{};
};

class TextWriter {
 public:
  explicit TextWriter(const Model& model) : model_(model) {}

  std::string write(const Service& service) {
    Reach reach;
    for (const Method& method : service.methods) {
      reach.add(model_, method.request.table);
      reach.add(model_, method.reply.table);
    }
    write_types(reach);
    write_service(service);
    return with_attributes();
  }

  std::string write() {
    Reach all;
    for (std::size_t index = 0; index < model_.objects.size(); ++index)
      all.objects.insert(index);
    for (std::size_t index = 0; index < model_.enums.size(); ++index)
      all.enums.insert(index);
    write_types(all);
    for (const Service& service : model_.services)
      write_service(service);
    return with_attributes();
  }

  std::string write(const Object& event) {
    Reach reach;
    reach.add(model_, static_cast<std::size_t>(&event - model_.objects.data()));
    write_types(reach);
    return with_attributes() + "\nroot_type " + event.name + ";\n";
  }

 private:
  void write_types(const Reach& reach) {
    // FlatBuffers requires enums, unions and structs to precede their uses; tables may have any
    // order.
    for (const bool is_union : {false, true}) {
      for (const std::size_t index : reach.enums) {
        if (model_.enums[index].is_union == is_union) write_enum(model_.enums[index]);
      }
      if (is_union) break;
      for (const std::size_t index : reach.objects) {
        if (model_.objects[index].is_struct) write_struct(index);
      }
    }
    for (const std::size_t index : reach.objects) {
      if (!model_.objects[index].is_struct) write_object(model_.objects[index]);
    }
  }

  [[nodiscard]] std::string with_attributes() const {
    std::string attributes;
    for (const KnownAttribute& known : kKnownAttributes) {
      if (text_.find(known.name) == std::string::npos) continue;
      attributes.append("attribute \"").append(known.name).append("\";\n");
    }
    return attributes + text_;
  }

  void enter(const std::string& name) {
    text_ += '\n';
    const std::string scope = namespace_of(name);
    if (scope == scope_) return;
    text_ += "namespace " + scope + ";\n\n";
    scope_ = scope;
  }

  /// Writes a struct after the structs that it contains.
  void write_struct(std::size_t index) {
    if (!written_.insert(index).second) return;
    for (const Field& field : model_.objects[index].fields) {
      if (field.type.has_object()) write_struct(*field.type.index);
    }
    write_object(model_.objects[index]);
  }

  void write_object(const Object& object) {
    enter(object.name);
    std::string align;
    for (const Attribute& attribute : object.attributes) {
      if (attribute.name == "force_align") align = attribute.value;
    }
    AttributeList attributes;
    attributes.number(object.event_id.has_value(), "rtpm_event", object.event_id.value_or(0));
    attributes.number(!align.empty(), "force_align", align.empty() ? 0 : std::stoull(align));
    text_ += comment(object.documentation, "") + (object.is_struct ? "struct " : "table ") +
             short_name(object.name) + attributes.str() + " {\n";
    for (const Field& field : object.fields) {
      // The union itself implies its type field.
      if (field.type.innermost() == BaseType::kUnionType) continue;
      write_field(object, field);
    }
    text_ += "}\n";
  }

  void write_field(const Object& object, const Field& field) {
    AttributeList attributes;
    attributes.flag(field.is_required && !field.is_key, "required");
    attributes.flag(field.is_deprecated, "deprecated").flag(field.is_key, "key");
    attributes.text("rtpm_unit", field.unit).text("rtpm_frame", field.frame);
    if (field.range) {
      attributes.text("rtpm_range",
                      number_text(field.range->low) + ".." + number_text(field.range->high));
    }
    for (const Attribute& attribute : field.attributes) {
      if (attribute.name == "flexbuffer") attributes.flag(true, attribute.name);
      if (attribute.name == "nested_flatbuffer") attributes.text(attribute.name, attribute.value);
      if (attribute.name == "force_align") {
        attributes.number(true, attribute.name, std::stoull(attribute.value));
      }
    }
    text_ += comment(field.documentation, "  ") + "  " + field.name + ':' +
             type_text(model_, field.type) + (object.is_struct ? "" : default_of(field)) +
             attributes.str() + ";\n";
  }

  /// The default as written in a schema; empty if it is the language's.
  [[nodiscard]] std::string default_of(const Field& field) const {
    if (field.type.base > BaseType::kDouble) return {};
    const std::string text = default_text(model_, field);
    if (field.type.index || field.is_optional) return " = " + text;
    if (text == "0") return {};
    return field.type.base == BaseType::kBool ? " = true" : " = " + text;
  }

  void write_enum(const Enum& enumeration) {
    enter(enumeration.name);
    text_ += comment(enumeration.documentation, "") + (enumeration.is_union ? "union " : "enum ") +
             short_name(enumeration.name);
    if (!enumeration.is_union) {
      text_ += " : " + std::string(spelling_of(enumeration.underlying)) +
               AttributeList().flag(enumeration.is_bit_flags, "bit_flags").str();
    }
    text_ += " {\n";
    for (const EnumValue& value : enumeration.values) {
      // FlatBuffers adds NONE to every union.
      if (enumeration.is_union && value.union_type.base == BaseType::kNone) continue;
      text_ += comment(value.documentation, "  ") + "  " + value.name;
      text_ += enumeration.is_union ? ':' + type_text(model_, value.union_type) + ",\n"
                                    : " = " + number_of(enumeration, value) + ",\n";
    }
    text_ += "}\n";
  }

  /// A value's number as a schema has it: of flags, the position of the bit.
  static std::string number_of(const Enum& enumeration, const EnumValue& value) {
    const auto bits = static_cast<std::uint64_t>(value.value);
    if (enumeration.is_bit_flags) return std::to_string(std::countr_zero(bits));
    return enumeration.underlying == BaseType::kUint64 ? std::to_string(bits)
                                                       : std::to_string(value.value);
  }

  void write_service(const Service& service) {
    enter(service.name);
    AttributeList attributes;
    attributes.number(service.priority.has_value(), "rtpm_priority", service.priority.value_or(0));
    if (service.priority_model == PriorityModel::kServerDeclared) {
      attributes.text("rtpm_priority_model", spelling_of(service.priority_model));
    }
    text_ += comment(service.documentation, "") + "rpc_service " + short_name(service.name) +
             attributes.str() + " {\n";
    for (const Method& method : service.methods) {
      AttributeList list;
      list.number(true, "rtpm_id", method.id).flag(method.is_idempotent, "rtpm_idempotent");
      list.number(method.deadline_us.has_value(), "rtpm_deadline_us",
                  method.deadline_us.value_or(0));
      if (method.oneway) list.text("rtpm_oneway", spelling_of(*method.oneway));
      if (method.role != Role::kCommand) list.text("rtpm_role", spelling_of(method.role));
      list.flag(method.is_deferred, "rtpm_deferred").flag(method.is_stream, "rtpm_stream");
      list.number(method.max_size.has_value(), "rtpm_max_size", method.max_size.value_or(0));
      text_ += comment(method.documentation, "  ") + "  " + method.name + '(' +
               model_.objects[method.request.table].name +
               "):" + model_.objects[method.reply.table].name + list.str() + ";\n";
    }
    text_ += "}\n";
  }

  const Model& model_;
  std::set<std::size_t> written_{};
  std::string scope_{};  // The namespace at the end of the text.
  std::string text_{};
};

}  // namespace

std::string schema_text(const Model& model) {
  return TextWriter(model).write();
}

std::string schema_text(const Model& model, const Service& service) {
  return TextWriter(model).write(service);
}

std::string schema_text(const Model& model, const Object& event) {
  return TextWriter(model).write(event);
}

}  // namespace rtpm::schema
