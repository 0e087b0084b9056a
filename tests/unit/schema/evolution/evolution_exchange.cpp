#include "evolution_exchange.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "scratch_folder.hpp"

namespace rtpm::schema::test {
namespace {

using nlohmann::json;

// Calls of each method; a change of the bytes shows in the first few.
constexpr int kCallCount = 30;

std::string random_number(const std::string& type, Random& random) {
  const auto pick = [&](std::vector<std::string> values) {
    return values[below(random, values.size())];
  };
  if (type == "bool") return pick({"true", "false"});
  if (type == "float" || type == "double") return pick({"0", "-1.5", "0.25", "1048576", "7", "3"});
  if (type == "byte") return pick({"0", "-128", "127", "-1", "7", "85"});
  if (type == "ubyte") return pick({"0", "255", "128", "7", "85"});
  if (type == "short") return pick({"0", "-32768", "32767", "-2", "7", "21845"});
  if (type == "ushort") return pick({"0", "65535", "32768", "7", "21845"});
  if (type == "int") return pick({"0", "-2147483648", "2147483647", "-3", "7", "1431655765"});
  if (type == "uint") return pick({"0", "4294967295", "2147483648", "7", "1431655765"});
  if (type == "long") return pick({"0", "-9223372036854775808", "-4", "7", "6148914691236517205"});
  return pick({"0", "18446744073709551615", "7", "6148914691236517205"});
}

/// Values as JSON text, for FlatBuffers' parser.
class ValueWriter {
 public:
  ValueWriter(const SchemaText& schema, Random& random) : schema_(schema), random_(random) {}

  std::string object(const TypeText& type) {
    std::string text = "{";
    for (const FieldText& field : type.fields) {
      if (field.is_deprecated) continue;
      const bool may_lack = type.kind == "table" && !field.is_required;
      if (may_lack && below(random_, 3) == 0) continue;
      text += (text.size() > 1 ? ", " : "") + member(field);
    }
    return text + "}";
  }

 private:
  std::string member(const FieldText& field) {
    const std::string lead = '"' + field.name;
    const TypeText* type = schema_.find(field.type);
    if (type != nullptr && type->kind == "union") {
      const FieldText& chosen = type->fields[below(random_, type->fields.size())];
      return lead + "_type\": \"" + chosen.name + "\", " + lead +
             "\": " + object(*schema_.find(chosen.type));
    }
    // Servers refuse numbers outside their ranges.
    if (!field.range.empty()) return lead + "\": " + (below(random_, 2) == 0 ? "0" : "7");
    return lead + "\": " + value(field.type);
  }

  std::string value(const std::string& type) {
    if (type.starts_with('[')) {
      const std::string element = type.substr(1, type.size() - 2);
      std::string text = "[";
      for (std::size_t count = below(random_, 4); count > 0; --count) {
        text += (text.size() > 1 ? ", " : "") + value(element);
      }
      return text + "]";
    }
    if (type == "string") {
      return '"' + std::string(1 + below(random_, 9), static_cast<char>('a' + below(random_, 26))) +
             '"';
    }
    const TypeText* found = schema_.find(type);
    if (found == nullptr) return random_number(type, random_);
    if (found->kind == "enum") {
      return '"' + found->fields[below(random_, found->fields.size())].name + '"';
    }
    return object(*found);
  }

  const SchemaText& schema_;
  Random& random_;
};

/// Reads verified bytes through the reflection.
class ValueReader {
 public:
  ValueReader(const reflection::Schema& schema, std::vector<const std::uint8_t*>& union_types)
      : schema_(schema), union_types_(union_types) {}

  json table(const reflection::Object& object, const flatbuffers::Table& table) const {
    json members = json::object();
    for (const reflection::Field* field : *object.fields()) {
      if (field->deprecated() || field->type()->base_type() == reflection::UType) continue;
      members[field->name()->str()] = member(object, *field, table);
    }
    return members;
  }

  /// Whether no required member was missing so far.
  [[nodiscard]] bool has_all_required() const noexcept { return has_all_required_; }

  json structure(const reflection::Object& object, const std::uint8_t* data) const {
    json members = json::object();
    for (const reflection::Field* field : *object.fields()) {
      members[field->name()->str()] = value(*field->type(), data + field->offset());
    }
    return members;
  }

 private:
  /// A member's value and whether it is present: a number always is, unless optional.
  json member(const reflection::Object& object, const reflection::Field& field,
              const flatbuffers::Table& table) const {
    const auto base = field.type()->base_type();
    const std::uint8_t* address = table.GetAddressOf(field.offset());
    if (base <= reflection::Double) {
      if (address != nullptr) return {{"value", value(*field.type(), address)}, {"is_set", true}};
      if (field.optional()) return {{"value", nullptr}, {"is_set", false}};
      return {{"value", default_of(field)}, {"is_set", false}};
    }
    // Generated code refuses the message then; the reflection's verifier does not check it.
    if (address == nullptr) has_all_required_ &= !field.required();
    if (address == nullptr) return {{"value", lost_union(object, field, table)}, {"is_set", false}};
    if (base == reflection::Union) {
      return {{"value", union_value(object, field, table, address)}, {"is_set", true}};
    }
    return {{"value", value(*field.type(), address)}, {"is_set", true}};
  }

  /// Unpacking and packing keeps the number of an unknown member of a union and loses the member.
  /// Null if the member is known.
  json lost_union(const reflection::Object& object, const reflection::Field& field,
                  const flatbuffers::Table& table) const {
    if (field.type()->base_type() != reflection::Union) return nullptr;
    const auto* type_field = object.fields()->LookupByKey((field.name()->str() + "_type").c_str());
    const auto number = table.GetField<std::uint8_t>(type_field->offset(), 0);
    const auto* values =
        schema_.enums()->Get(static_cast<flatbuffers::uoffset_t>(field.type()->index()))->values();
    return number != 0 && values->LookupByKey(number) == nullptr ? unknown(*values) : json(nullptr);
  }

  json union_value(const reflection::Object& object, const reflection::Field& field,
                   const flatbuffers::Table& table, const std::uint8_t* address) const {
    const auto* type_field = object.fields()->LookupByKey((field.name()->str() + "_type").c_str());
    union_types_.push_back(table.GetAddressOf(type_field->offset()));
    const auto number = table.GetField<std::uint8_t>(type_field->offset(), 0);
    const auto* values =
        schema_.enums()->Get(static_cast<flatbuffers::uoffset_t>(field.type()->index()))->values();
    const auto* member = values->LookupByKey(number);
    if (member == nullptr || number == 0) return unknown(*values);
    const auto& inner =
        *schema_.objects()->Get(static_cast<flatbuffers::uoffset_t>(member->union_type()->index()));
    const auto* start = address + flatbuffers::ReadScalar<flatbuffers::uoffset_t>(address);
    return {{"member", member->name()->str()},
            {"value", this->table(inner, *reinterpret_cast<const flatbuffers::Table*>(start))}};
  }

  json default_of(const reflection::Field& field) const {
    if (field.type()->base_type() >= reflection::Float) return field.default_real();
    if (field.type()->base_type() == reflection::Bool) return field.default_integer() != 0;
    if (field.type()->base_type() == reflection::ULong) {
      return static_cast<std::uint64_t>(field.default_integer());
    }
    return named(*field.type(), field.default_integer());
  }

  /// The JSON for a number without a name, with the existing names.
  template <class Values>
  static json unknown(const Values& values) {
    json names = json::array();
    for (const auto* value : values)
      names.push_back(value->name()->str());
    return {{"unknown", names}};
  }

  /// The name of an enum's value, if it has one.
  json named(const reflection::Type& type, std::int64_t number) const {
    if (type.index() < 0) return number;
    const auto* values =
        schema_.enums()->Get(static_cast<flatbuffers::uoffset_t>(type.index()))->values();
    const auto* found = values->LookupByKey(number);
    return found ? json(found->name()->str()) : unknown(*values);
  }

  json value(const reflection::Type& type, const std::uint8_t* at) const {
    switch (type.base_type()) {
      case reflection::Obj: {
        const auto& object =
            *schema_.objects()->Get(static_cast<flatbuffers::uoffset_t>(type.index()));
        if (object.is_struct()) return structure(object, at);
        const auto* start = at + flatbuffers::ReadScalar<flatbuffers::uoffset_t>(at);
        return table(object, *reinterpret_cast<const flatbuffers::Table*>(start));
      }
      case reflection::String: {
        const auto* start = at + flatbuffers::ReadScalar<flatbuffers::uoffset_t>(at);
        return reinterpret_cast<const flatbuffers::String*>(start)->str();
      }
      case reflection::Vector:
        return vector(type, at + flatbuffers::ReadScalar<flatbuffers::uoffset_t>(at));
      default:
        return number(type, type.base_type(), at);
    }
  }

  json number(const reflection::Type& type, reflection::BaseType base,
              const std::uint8_t* at) const {
    if (base == reflection::Bool) return *at != 0;
    if (base == reflection::Float || base == reflection::Double) {
      return flatbuffers::GetAnyValueF(base, at);
    }
    if (base == reflection::ULong) return flatbuffers::ReadScalar<std::uint64_t>(at);
    return named(type, flatbuffers::GetAnyValueI(base, at));
  }

  json vector(const reflection::Type& type, const std::uint8_t* start) const {
    json elements = json::array();
    const auto count = flatbuffers::ReadScalar<flatbuffers::uoffset_t>(start);
    const std::uint8_t* at = start + sizeof count;
    std::size_t step = flatbuffers::GetTypeSize(type.element());
    const reflection::Object* object = nullptr;
    if (type.element() == reflection::Obj) {
      object = schema_.objects()->Get(static_cast<flatbuffers::uoffset_t>(type.index()));
      step = object->is_struct() ? static_cast<std::size_t>(object->bytesize()) : 4;
    }
    for (flatbuffers::uoffset_t i = 0; i < count; ++i, at += step) {
      if (object != nullptr && object->is_struct()) {
        elements.push_back(structure(*object, at));
      } else if (object != nullptr) {
        const auto* inner = at + flatbuffers::ReadScalar<flatbuffers::uoffset_t>(at);
        elements.push_back(table(*object, *reinterpret_cast<const flatbuffers::Table*>(inner)));
      } else if (type.element() == reflection::String) {
        const auto* inner = at + flatbuffers::ReadScalar<flatbuffers::uoffset_t>(at);
        elements.push_back(reinterpret_cast<const flatbuffers::String*>(inner)->str());
      } else {
        elements.push_back(number(type, type.element(), at));
      }
    }
    return elements;
  }

  const reflection::Schema& schema_;
  std::vector<const std::uint8_t*>& union_types_;
  mutable bool has_all_required_ = true;
};

bool is_member(const json& value) {
  return value.is_object() && value.contains("is_set");
}

/// Whether one message from `writer` to `reader` arrives.
bool arrives(Side& writer, const Payload& sent, Side& reader, const Payload& expected,
             Random& random) {
  const auto name = [](const Side& side, const Payload& payload) {
    return side.model().objects[payload.table].name;
  };
  const std::string bytes = writer.write(name(writer, sent), sent.kind, random);
  std::vector<std::size_t> union_types;
  const auto written = writer.read(name(writer, sent), sent.kind, bytes, bytes, &union_types);
  EXPECT_TRUE(written) << "a side does not read what it wrote itself\n" << writer.schema().text();
  // Generated code accepts an unknown member of a union, the reflection's verifier does not.
  std::string verified = bytes;
  const TypeText* choice = reader.schema().find("Choice");
  for (const std::size_t place : union_types) {
    if (static_cast<std::size_t>(verified[place]) > choice->fields.size()) verified[place] = 0;
  }
  const auto read = reader.read(name(reader, expected), expected.kind, bytes, verified);
  return written && read && is_understood(*written, *read);
}

const Method* find_method(const Side& side, std::uint16_t id) {
  for (const Method& method : side.model().services.front().methods) {
    if (method.id == id) return &method;
  }
  return nullptr;
}

}  // namespace

Side::Side(const SchemaText& schema) : schema_(schema), model_(model_of(schema.text())) {
  flatbuffers::IDLOptions options;
  options.strict_json = true;
  parser_ = std::make_unique<flatbuffers::Parser>(options);
  const char* folders[] = {RTPM_IDL_FOLDER, nullptr};
  // Code by flatc ignores deprecated fields; the parser would require them.
  SchemaText as_generated = schema;
  for (TypeText& type : as_generated.types) {
    for (FieldText& field : type.fields)
      field.is_required &= !field.is_deprecated;
  }
  const std::string text = as_generated.text();
  EXPECT_TRUE(parser_->Parse(text.c_str(), folders, "arm.fbs")) << parser_->error_ << text;
  parser_->Serialize();
  reflection_.assign(reinterpret_cast<const char*>(parser_->builder_.GetBufferPointer()),
                     parser_->builder_.GetSize());
}

std::string Side::write(const std::string& table, PayloadKind kind, Random& random) {
  if (kind == PayloadKind::kEmpty) return {};
  const TypeText& type = *schema_.find(short_name(table));
  const std::string text = ValueWriter(schema_, random).object(type);
  EXPECT_TRUE(parser_->SetRootType(table.c_str()));
  EXPECT_TRUE(parser_->Parse(text.c_str())) << parser_->error_ << '\n' << text;
  const std::uint8_t* bytes = parser_->builder_.GetBufferPointer();
  if (kind == PayloadKind::kTable) {
    return {reinterpret_cast<const char*>(bytes), parser_->builder_.GetSize()};
  }
  const auto& schema = *reflection::GetSchema(reflection_.data());
  const auto* object = schema.objects()->LookupByKey(table.c_str());
  const auto& field = *object->fields()->Get(0);
  const auto& inner =
      *schema.objects()->Get(static_cast<flatbuffers::uoffset_t>(field.type()->index()));
  const auto* root = flatbuffers::GetRoot<flatbuffers::Table>(bytes);
  return {reinterpret_cast<const char*>(root->GetAddressOf(field.offset())),
          static_cast<std::size_t>(inner.bytesize())};
}

std::optional<json> Side::read(const std::string& table, PayloadKind kind, const std::string& bytes,
                               const std::string& verified,
                               std::vector<std::size_t>* union_types) const {
  if (kind == PayloadKind::kEmpty) {
    return bytes.empty() ? std::optional(json::object()) : std::nullopt;
  }
  const auto& schema = *reflection::GetSchema(reflection_.data());
  const auto* object = schema.objects()->LookupByKey(table.c_str());
  std::vector<std::uint64_t> aligned((bytes.size() + 7) / 8);
  auto* data = reinterpret_cast<std::uint8_t*>(aligned.data());
  std::memcpy(data, (verified.empty() ? bytes : verified).data(), bytes.size());
  std::vector<const std::uint8_t*> types;
  const ValueReader reader(schema, types);
  if (kind == PayloadKind::kStruct) {
    const auto& field = *object->fields()->Get(0);
    const auto& inner =
        *schema.objects()->Get(static_cast<flatbuffers::uoffset_t>(field.type()->index()));
    if (bytes.size() != static_cast<std::size_t>(inner.bytesize())) return std::nullopt;
    return reader.structure(inner, data);
  }
  if (bytes.size() < 8 ||
      (!verified.empty() && !flatbuffers::Verify(schema, *object, data, bytes.size()))) {
    return std::nullopt;
  }
  std::memcpy(data, bytes.data(), bytes.size());
  json members = reader.table(*object, *flatbuffers::GetRoot<flatbuffers::Table>(data));
  for (const std::uint8_t* type : types) {
    if (union_types && type) union_types->push_back(static_cast<std::size_t>(type - data));
  }
  return reader.has_all_required() ? std::optional(std::move(members)) : std::nullopt;
}

bool is_understood(const json& written, const json& read) {
  // A number without a name is not misread, unless the reader has its name under another number.
  if (read.is_object() && read.contains("unknown")) {
    const json& name =
        written.is_object() && written.contains("member") ? written["member"] : written;
    const json& names = read["unknown"];
    return std::find(names.begin(), names.end(), name) == names.end();
  }
  if (written.is_object() && read.is_object()) {
    for (const auto& [name, value] : read.items()) {
      if (written.contains(name)) {
        if (is_member(value) && is_member(written[name])) {
          if (!is_understood(written[name]["value"], value["value"])) return false;
        } else if (!is_understood(written[name], value)) {
          return false;
        }
      } else if (!is_member(value) || value["is_set"].get<bool>()) {
        return false;
      }
    }
    return true;
  }
  if (written.is_array() && read.is_array()) {
    if (written.size() != read.size()) return false;
    for (std::size_t i = 0; i < written.size(); ++i) {
      if (!is_understood(written[i], read[i])) return false;
    }
    return true;
  }
  return written.type() == read.type() || (written.is_number_integer() && read.is_number_integer())
             ? written == read
             : false;
}

bool can_call(Side& client, Side& server, Random& random) {
  for (const Method& calls : client.model().services.front().methods) {
    const Method* serves = find_method(server, calls.id);
    if (serves == nullptr || serves->name != calls.name) return false;
    for (int i = 0; i < kCallCount; ++i) {
      if (!arrives(client, calls.request, server, serves->request, random) ||
          !arrives(server, serves->reply, client, calls.reply, random)) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace rtpm::schema::test
