#include "evolution_schema.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace rtpm::schema::test {
namespace {

constexpr const char* kNumbers[] = {"byte", "ubyte", "short", "ushort", "int",
                                    "uint", "long",  "ulong", "float",  "double"};

std::string number_type(Random& random) {
  return kNumbers[below(random, std::size(kNumbers))];
}

bool is_number(const std::string& type) {
  return std::find(std::begin(kNumbers), std::end(kNumbers), type) != std::end(kNumbers);
}

/// A field of a table, of any kind.
/// @param tables  the tables that are defined before the field
FieldText random_field(Random& random, const std::string& name,
                       const std::vector<std::string>& tables) {
  FieldText field{.name = name};
  switch (below(random, 12)) {
    case 0:
      field.type = "string";
      break;
    case 1:
      field.type = "[" + number_type(random) + "]";
      break;
    case 2:
      field.type = "[string]";
      break;
    case 3:
      field.type = "Point";
      break;
    case 4:
      field.type = "[Point]";
      break;
    case 5:
      field.type = "Mode";
      field.default_value = below(random, 2) == 0 ? "Hold" : "Free";
      break;
    case 6:
      field.type = "Choice";
      break;
    case 7:
      field.type = tables.empty() ? "bool" : tables[below(random, tables.size())];
      break;
    case 8:
      field.type = tables.empty() ? "int" : "[" + tables[below(random, tables.size())] + "]";
      break;
    case 9:
      field.type = number_type(random);
      field.default_value = "null";
      break;
    case 10:
      field.type = number_type(random);
      field.default_value = std::to_string(1 + below(random, 100));
      break;
    default:
      field.type = number_type(random);
      field.unit = "newton";
      field.frame = "base";
      field.range = "0..100";
      break;
  }
  if (!field.type.empty() && field.default_value.empty() && !is_number(field.type) &&
      field.type != "Mode" && field.type != "Choice" && field.type != "bool") {
    field.is_required = below(random, 4) == 0;
  }
  return field;
}

TypeText random_table(Random& random, const std::string& name,
                      const std::vector<std::string>& tables) {
  TypeText table{.kind = "table", .name = name};
  const std::size_t count = 3 + below(random, 5);
  for (std::size_t i = 0; i < count; ++i) {
    table.fields.push_back(random_field(random, "f" + std::to_string(i), tables));
  }
  return table;
}

std::string attributes_of(const FieldText& field) {
  std::string text;
  const auto add = [&](bool is_there, const std::string& attribute) {
    if (is_there) text += (text.empty() ? "" : ", ") + attribute;
  };
  add(field.is_required, "required");
  add(field.is_deprecated, "deprecated");
  add(field.is_key, "key");
  add(!field.unit.empty(), "rtpm_unit: \"" + field.unit + '"');
  add(!field.frame.empty(), "rtpm_frame: \"" + field.frame + '"');
  add(!field.range.empty(), "rtpm_range: \"" + field.range + '"');
  return text.empty() ? "" : " (" + text + ")";
}

std::string text_of(const TypeText& type) {
  std::string text = type.kind + ' ' + type.name;
  if (type.kind == "enum") text += " : " + type.underlying;
  if (type.event != 0) text += " (rtpm_event: " + std::to_string(type.event) + ')';
  text += " {\n";
  for (const FieldText& field : type.fields) {
    if (type.kind == "enum") {
      text += "  " + field.name + " = " + field.default_value + ",\n";
    } else if (type.kind == "union") {
      text += "  " + field.name + ':' + field.type + ",\n";
    } else {
      text += "  " + field.name + ':' + field.type;
      if (!field.default_value.empty()) text += " = " + field.default_value;
      text += attributes_of(field) + ";\n";
    }
  }
  return text + "}\n";
}

std::string text_of(const MethodText& method) {
  std::string text = "  " + method.name + '(' + method.request + "):" + method.reply +
                     " (rtpm_id: " + std::to_string(method.id);
  if (method.is_idempotent) text += ", rtpm_idempotent";
  if (method.is_deferred) text += ", rtpm_deferred";
  if (method.deadline_us != 0) text += ", rtpm_deadline_us: " + std::to_string(method.deadline_us);
  if (method.max_size != 0) text += ", rtpm_max_size: " + std::to_string(method.max_size);
  return text + ");\n";
}

/// A schema and a random generator for its edit.
struct Edit {
  SchemaText& schema;
  Random& random;

  TypeText& type(const std::string& name) const {
    return *std::find_if(schema.types.begin(), schema.types.end(),
                         [&](const TypeText& candidate) { return candidate.name == name; });
  }
  /// One of the tables with several fields.
  TypeText& table() const {
    constexpr const char* kTables[] = {"Leaf", "Branch", "Request", "Reply"};
    return type(kTables[below(random, std::size(kTables))]);
  }
  FieldText& field(TypeText& table) const {
    return table.fields[below(random, table.fields.size())];
  }
  MethodText& method() const { return schema.methods[below(random, schema.methods.size())]; }
  std::string fresh(const std::string& lead) const {
    return lead + std::to_string(1000 + below(random, 100000));
  }
};

using Outcome = std::optional<ChangeKind>;
using Kind = ChangeKind;

// ---- edits of tables

Outcome append_field(const Edit& edit) {
  FieldText field = random_field(edit.random, edit.fresh("n"), {"Leaf"});
  field.is_required = false;
  TypeText& table = edit.table();
  if (table.name == "Leaf" && (field.type == "Leaf" || field.type == "[Leaf]"))
    field.type = "string";
  table.fields.push_back(field);
  return Kind::kFieldAdded;
}
Outcome append_required(const Edit& edit) {
  edit.table().fields.push_back({.name = edit.fresh("n"), .type = "string", .is_required = true});
  return Kind::kFieldAddedRequired;
}
Outcome remove_last_field(const Edit& edit) {
  TypeText& table = edit.table();
  // The table must keep several fields.
  if (table.fields.size() < 3) return std::nullopt;
  table.fields.pop_back();
  return Kind::kFieldRemoved;
}
Outcome insert_field(const Edit& edit) {
  TypeText& table = edit.table();
  table.fields.insert(table.fields.begin(), {.name = edit.fresh("n"), .type = "int"});
  return Kind::kFieldMoved;
}
Outcome swap_fields(const Edit& edit) {
  TypeText& table = edit.table();
  std::swap(table.fields.front(), table.fields.back());
  return Kind::kFieldMoved;
}
Outcome rename_field(const Edit& edit) {
  edit.field(edit.table()).name = edit.fresh("r");
  return Kind::kFieldRenamed;
}
Outcome retype_field(const Edit& edit) {
  FieldText& field = edit.field(edit.table());
  if (field.is_deprecated || field.type == "Choice") return std::nullopt;
  field.type = field.type == "string" ? "[Point]" : "string";
  field.default_value.clear();
  field.unit.clear();
  field.frame.clear();
  field.range.clear();
  return Kind::kFieldRetyped;
}
Outcome retype_number(const Edit& edit) {
  FieldText& field = edit.field(edit.table());
  if (!is_number(field.type)) return std::nullopt;
  const std::string before = std::exchange(field.type, number_type(edit.random));
  return before == field.type ? std::nullopt : Outcome(Kind::kFieldRetyped);
}
Outcome change_default(const Edit& edit) {
  FieldText& field = edit.field(edit.table());
  if (!is_number(field.type) || field.is_deprecated || !field.range.empty()) return std::nullopt;
  const bool had_none = field.default_value.empty();
  field.default_value = field.default_value == "null" || had_none ? "7" : "null";
  return Kind::kFieldDefault;
}
Outcome deprecate_field(const Edit& edit) {
  FieldText& field = edit.field(edit.table());
  if (field.is_deprecated || field.is_required) return std::nullopt;
  field.is_deprecated = true;
  return Kind::kFieldDeprecated;
}
Outcome deprecate_required(const Edit& edit) {
  FieldText& field = edit.field(edit.table());
  if (field.is_deprecated || !field.is_required) return std::nullopt;
  field.is_deprecated = true;
  return Kind::kFieldDeprecated;
}
Outcome undeprecate_field(const Edit& edit) {
  FieldText& field = edit.type("Request").fields.front();
  field.is_deprecated = false;
  return Kind::kFieldUndeprecated;
}
Outcome toggle_required(const Edit& edit) {
  FieldText& field = edit.field(edit.table());
  const bool is_vector = field.type.starts_with('[');
  if ((field.type != "string" && !is_vector && field.type != "Point") || field.is_deprecated) {
    return std::nullopt;
  }
  field.is_required = !field.is_required;
  return field.is_required ? Kind::kFieldRequired : Kind::kFieldNotRequired;
}
Outcome change_unit(const Edit& edit) {
  FieldText& field = edit.field(edit.table());
  if (field.unit.empty()) return std::nullopt;
  field.unit = "millinewton";
  return Kind::kFieldUnit;
}
Outcome change_frame(const Edit& edit) {
  FieldText& field = edit.field(edit.table());
  if (field.frame.empty()) return std::nullopt;
  field.frame = "world";
  return Kind::kFieldFrame;
}
Outcome change_range(const Edit& edit) {
  FieldText& field = edit.field(edit.table());
  if (field.range.empty()) return std::nullopt;
  const bool is_narrowed = below(edit.random, 2) == 0;
  field.range = is_narrowed ? "0..50" : "0..120";
  return is_narrowed ? Kind::kFieldRangeNarrowed : Kind::kFieldRangeWidened;
}

// ---- edits of structs, enums and unions

Outcome grow_struct(const Edit& edit) {
  edit.type("Point").fields.push_back({.name = edit.fresh("n"), .type = number_type(edit.random)});
  return Kind::kStructLayout;
}
Outcome retype_struct_field(const Edit& edit) {
  FieldText& field = edit.field(edit.type("Point"));
  field.type = field.type == "double" ? "long" : "double";
  return Kind::kStructLayout;
}
Outcome rename_struct_field(const Edit& edit) {
  edit.field(edit.type("Point")).name = edit.fresh("r");
  return Kind::kFieldRenamed;
}
Outcome add_enum_value(const Edit& edit) {
  edit.type("Mode").fields.push_back({.name = edit.fresh("V"), .default_value = "90"});
  return Kind::kEnumValueAdded;
}
Outcome remove_enum_value(const Edit& edit) {
  edit.type("Mode").fields.pop_back();
  return Kind::kEnumValueRemoved;
}
Outcome renumber_enum_value(const Edit& edit) {
  edit.type("Mode").fields.back().default_value = "80";
  return Kind::kEnumValueRenumbered;
}
Outcome rename_enum_value(const Edit& edit) {
  edit.type("Mode").fields.back().name = edit.fresh("R");
  return Kind::kEnumValueRenamed;
}
Outcome change_underlying(const Edit& edit) {
  edit.type("Mode").underlying = "int";
  return Kind::kEnumUnderlying;
}
Outcome add_union_member(const Edit& edit) {
  edit.type("Choice").fields.push_back({.name = edit.fresh("M"), .type = "Leaf"});
  return Kind::kEnumValueAdded;
}
Outcome swap_union_members(const Edit& edit) {
  auto& fields = edit.type("Choice").fields;
  std::swap(fields.front(), fields.back());
  return Kind::kEnumValueRenumbered;
}
Outcome retype_union_member(const Edit& edit) {
  FieldText& member = edit.type("Choice").fields.front();
  member.type = member.type == "Leaf" ? "Twig" : "Leaf";
  return Kind::kUnionMemberRetyped;
}

// ---- edits of methods

Outcome add_method(const Edit& edit) {
  MethodText method = edit.method();
  method.name = edit.fresh("m");
  method.id = 500 + static_cast<std::uint32_t>(below(edit.random, 1000));
  edit.schema.methods.push_back(method);
  return Kind::kMethodAdded;
}
Outcome remove_method(const Edit& edit) {
  // Other methods use the method's types, too.
  edit.schema.methods.pop_back();
  return Kind::kMethodRemoved;
}
Outcome rename_method(const Edit& edit) {
  edit.method().name = edit.fresh("r");
  return Kind::kMethodRenamed;
}
Outcome renumber_method(const Edit& edit) {
  edit.method().id = 2000 + static_cast<std::uint32_t>(below(edit.random, 1000));
  return Kind::kMethodRenumbered;
}
Outcome replace_payload(const Edit& edit) {
  MethodText& method = edit.schema.methods.back();
  method.request = method.request == "Reply" ? "Request" : "Reply";
  return Kind::kPayloadReplaced;
}
Outcome grow_struct_message(const Edit& edit) {
  edit.type("PointMessage").fields.push_back({.name = edit.fresh("n"), .type = "int"});
  return Kind::kPayloadKind;
}
Outcome toggle_idempotent(const Edit& edit) {
  MethodText& method = edit.method();
  method.is_idempotent = !method.is_idempotent;
  return method.is_idempotent ? Kind::kIdempotentAdded : Kind::kIdempotentRemoved;
}
Outcome toggle_deferred(const Edit& edit) {
  MethodText& method = edit.method();
  method.is_deferred = !method.is_deferred;
  return Kind::kDeferredChanged;
}
Outcome change_deadline(const Edit& edit) {
  edit.method().deadline_us = 12345;
  return Kind::kDeadlineChanged;
}
Outcome change_priority(const Edit& edit) {
  edit.schema.priority += 1;
  return Kind::kPriorityChanged;
}

constexpr Outcome (*kEdits[])(const Edit&) = {
    append_field,        append_required,     remove_last_field,   insert_field,
    swap_fields,         rename_field,        retype_field,        retype_number,
    change_default,      deprecate_field,     deprecate_required,  undeprecate_field,
    toggle_required,     change_unit,         change_frame,        change_range,
    grow_struct,         retype_struct_field, rename_struct_field, add_enum_value,
    remove_enum_value,   renumber_enum_value, rename_enum_value,   change_underlying,
    add_union_member,    swap_union_members,  retype_union_member, add_method,
    remove_method,       rename_method,       renumber_method,     replace_payload,
    grow_struct_message, toggle_idempotent,   toggle_deferred,     change_deadline,
    change_priority,
};

}  // namespace

std::string SchemaText::text() const {
  std::string text = "include \"rtpm.fbs\";\nnamespace " + name_space + ";\n";
  for (const TypeText& type : types)
    text += text_of(type);
  text += "rpc_service Arm (rtpm_priority: " + std::to_string(priority) + ") {\n";
  for (const MethodText& method : methods)
    text += text_of(method);
  return text + "}\n";
}

const TypeText* SchemaText::find(const std::string& name) const {
  const auto found = std::find_if(types.begin(), types.end(),
                                  [&](const TypeText& type) { return type.name == name; });
  return found == types.end() ? nullptr : &*found;
}

SchemaText random_schema(Random& random) {
  SchemaText schema;
  schema.types.push_back({.kind = "enum",
                          .name = "Mode",
                          .underlying = "ubyte",
                          .fields = {{.name = "Free", .default_value = "0"},
                                     {.name = "Hold", .default_value = "1"},
                                     {.name = "Follow", .default_value = "7"}}});
  TypeText point{.kind = "struct", .name = "Point"};
  const std::size_t count = 1 + below(random, 4);
  for (std::size_t i = 0; i < count; ++i) {
    point.fields.push_back({.name = "p" + std::to_string(i), .type = number_type(random)});
  }
  schema.types.push_back(point);
  schema.types.push_back(
      {.kind = "union",
       .name = "Choice",
       .fields = {{.name = "Small", .type = "Twig"}, {.name = "Large", .type = "Leaf"}}});
  schema.types.push_back({.kind = "table",
                          .name = "Twig",
                          .fields = {{.name = "t", .type = "int", .default_value = "3"}}});
  // A union inside of a union would be recursive.
  TypeText leaf = random_table(random, "Leaf", {});
  for (FieldText& field : leaf.fields) {
    if (field.type == "Choice") field.type = "string";
  }
  schema.types.push_back(leaf);
  schema.types.push_back(random_table(random, "Branch", {"Leaf"}));
  TypeText request = random_table(random, "Request", {"Leaf", "Branch"});
  request.fields.insert(request.fields.begin(),
                        {.name = "gone", .type = "int", .is_deprecated = true});
  request.fields.push_back({.name = "branch", .type = "Branch"});
  request.fields.push_back({.name = "mode", .type = "Mode", .default_value = "Hold"});
  request.fields.push_back({.name = "choice", .type = "Choice"});
  schema.types.push_back(request);
  TypeText reply = random_table(random, "Reply", {"Leaf", "Branch"});
  reply.fields.push_back({.name = "leaves", .type = "[Leaf]"});
  reply.fields.push_back({.name = "place", .type = "Point"});
  schema.types.push_back(reply);
  schema.types.push_back({.kind = "table",
                          .name = "PointMessage",
                          .fields = {{.name = "value", .type = "Point", .is_required = true}}});
  schema.methods = {{.name = "ask", .id = 1, .request = "Request", .reply = "Reply"},
                    {.name = "move", .id = 2, .request = "PointMessage", .reply = "rtpm.Empty"},
                    {.name = "tell", .id = 3, .request = "Branch", .reply = "PointMessage"},
                    {.name = "show", .id = 4, .request = "rtpm.Empty", .reply = "Reply"},
                    {.name = "again", .id = 9, .request = "Reply", .reply = "Request"}};
  return schema;
}

std::optional<ChangeKind> edit(SchemaText& schema, Random& random) {
  const Edit context{schema, random};
  return kEdits[below(random, std::size(kEdits))](context);
}

}  // namespace rtpm::schema::test
