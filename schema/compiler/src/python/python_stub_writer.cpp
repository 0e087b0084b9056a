#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emit/prose.hpp"
#include "model/quantities.hpp"
#include "model/spelling.hpp"
#include "python/python_writer.hpp"
#include "rtpm/schema/python_names.hpp"

namespace rtpm::schema::python {
namespace {

/// The names that annotations use, and the imports and aliases that they need.
class Names {
 public:
  explicit Names(const Model& model) : model_(model) {
    for (const Object& object : model.objects) {
      if (is_in_python(object)) classes_.insert(python_type_name(model, object.name));
    }
    for (const Enum& enumeration : model.enums)
      classes_.insert(python_type_name(model, enumeration.name));
    for (const Service& service : model.services) {
      for (const char* suffix : {"Client", "AsyncClient", "Servant"})
        classes_.insert(python_type_name(model, service.name) + suffix);
    }
  }

  /// Begins a class: inside it, its members hide names of the module and of Python.
  void enter(std::set<std::string> members) { members_ = std::move(members); }
  void leave() { members_.clear(); }

  std::string module(const std::string& name) {
    const std::string spelled = spelling_of_foreign(name);
    modules_.insert(name + (spelled == name ? "" : " as " + spelled));
    return spelled;
  }
  std::string from(const std::string& module, const std::string& name) {
    const std::string spelled = spelling_of_foreign(name);
    froms_[module].insert(name + (spelled == name ? "" : " as " + spelled));
    return spelled;
  }
  std::string builtin(const std::string& name) {
    return is_hidden(name) ? from("builtins", name) : name;
  }
  std::string type(const std::string& qualified_name) {
    const std::string name = python_type_name(model_, qualified_name);
    if (!members_.contains(name)) return name;
    const std::string alias = free_alias(name);
    aliases_.emplace(alias, name);
    return alias;
  }

  /// Definitions of names for classes whose members have the same names as types.
  std::string aliases() {
    std::string text;
    for (const auto& [alias, name] : aliases_)
      text += alias + ": " + from("typing", "TypeAlias") + " = " + name + '\n';
    return text;
  }

  /// In the order that isort gives them.
  [[nodiscard]] std::string imports() const {
    const auto lines_of = [&](bool is_rtpm) {
      std::string text;
      for (const std::string& module : modules_) {
        if (module.starts_with("rtpm") == is_rtpm) text += "import " + module + '\n';
      }
      if (is_rtpm) return text;
      for (const auto& [module, names] : froms_) {
        std::string list;
        for (const std::string& name : names)
          list += (list.empty() ? "" : ", ") + name;
        text += "from " + module + " import " + list + '\n';
      }
      return text;
    };
    std::string text;
    for (const bool is_rtpm : {false, true}) {
      if (const std::string lines = lines_of(is_rtpm); !lines.empty()) text += '\n' + lines;
    }
    return text;
  }

 private:
  [[nodiscard]] bool is_hidden(const std::string& name) const {
    return members_.contains(name) || classes_.contains(name);
  }
  [[nodiscard]] std::string free_alias(const std::string& name) const {
    std::string alias = '_' + name;
    while (is_hidden(alias))
      alias += '_';
    return alias;
  }
  [[nodiscard]] std::string spelling_of_foreign(const std::string& name) const {
    return is_hidden(name) ? free_alias(name) : name;
  }

  const Model& model_;
  std::set<std::string> classes_{};
  std::set<std::string> members_{};
  std::set<std::string> modules_{};
  std::map<std::string, std::set<std::string>> froms_{};
  std::map<std::string, std::string> aliases_{};
};

/// A member's comment in one line: "x: the force along x (newton, -20 to 20)"; none if there is
/// nothing to say.
Documentation line_of(const std::string& name, const Documentation& documentation,
                      const std::string& quantity) {
  const std::string note = emit::member_note(documentation, quantity);
  return note.empty() ? Documentation{} : Documentation{name + ": " + note};
}

class StubWriter {
 public:
  explicit StubWriter(const Model& model) : model_(model), names_(model) {}

  std::string write(const std::string& compiler_version) {
    std::string body = types();
    for (const Service& service : model_.services)
      body += service_classes(service);
    if (const std::string aliases = names_.aliases(); !aliases.empty()) body += '\n' + aliases;
    return banner(model_, compiler_version) + "from __future__ import annotations\n" +
           names_.imports() + included_types() + body;
  }

 private:
  [[nodiscard]] bool is_own(const std::string& declaration_file) const {
    return declaration_file == model_.declaration_file;
  }

  [[nodiscard]] std::string included_types() const {
    std::set<std::string> lines;
    const auto add = [&](const auto& type) {
      if (is_own(type.declaration_file)) return;
      const std::string& file = type.declaration_file;
      lines.insert("from ." + python_module_name(std::filesystem::path(file).stem().string()) +
                   " import " + name_in_module_of(model_, type.name, file) + " as " +
                   python_type_name(model_, type.name) + '\n');
    };
    std::ranges::for_each(model_.enums, add);
    for (const Object& object : model_.objects) {
      if (is_in_python(object)) add(object);
    }
    std::string text = lines.empty() ? "" : "\n";
    for (const std::string& line : lines)
      text += line;
    return text;
  }

  /// The types, then the events, in the order of their declarations.
  std::string types() {
    std::vector<std::pair<std::pair<bool, std::size_t>, std::string>> classes;
    for (const Enum& enumeration : model_.enums) {
      if (!is_own(enumeration.declaration_file)) continue;
      classes.push_back(
          {{false, enumeration.location.line},
           enumeration.is_union ? union_alias(enumeration) : enum_class(enumeration)});
    }
    for (const Object& object : model_.objects) {
      if (!is_own(object.declaration_file) || !is_in_python(object)) continue;
      classes.push_back(
          {{object.event_id.has_value(), object.location.line}, object_class(object)});
    }
    std::ranges::stable_sort(classes, {}, [](const auto& entry) { return entry.first; });
    std::string text;
    for (const auto& entry : classes)
      text += entry.second;
    return text;
  }

  /// A class with its blank lines as black sets them.
  static std::string class_text(const std::string& name, const std::string& base,
                                const Documentation& documentation, const std::string& body) {
    const std::string head = "\nclass " + name + '(' + base + "):";
    const std::string docs = docstring(documentation, "    ");
    if (docs.empty()) return head + (body.empty() ? " ...\n" : '\n' + body);
    return head + '\n' + docs + (body.empty() ? "" : '\n' + body);
  }

  std::string union_alias(const Enum& enumeration) {
    std::vector<std::string> types;
    for (const EnumValue& value : enumeration.values) {
      if (value.union_type.base == BaseType::kNone) continue;
      const std::string type = one(value.union_type.base, value.union_type);
      if (std::ranges::find(types, type) == types.end()) types.push_back(type);
    }
    return '\n' + alternatives(python_type_name(model_, enumeration.name) + ": " +
                                   names_.from("typing", "TypeAlias") + " = ",
                               types);
  }

  std::string enum_class(const Enum& enumeration) {
    Documentation notes;
    std::string body;
    for (const EnumValue& value : enumeration.values) {
      const std::string name = python_name(value.name);
      std::ranges::copy(line_of(name, value.documentation, {}), std::back_inserter(notes));
      body += "    " + name + " = " +
              (enumeration.underlying == BaseType::kUint64
                   ? std::to_string(static_cast<std::uint64_t>(value.value))
                   : std::to_string(value.value)) +
              '\n';
    }
    Documentation lines = enumeration.documentation;
    emit::add_paragraph(lines, notes);
    return class_text(python_type_name(model_, enumeration.name),
                      names_.module("enum") + (enumeration.is_bit_flags ? ".IntFlag" : ".IntEnum"),
                      lines, body);
  }

  /// A struct of real numbers only is a vector, with arithmetic.
  static std::string base_of(const Object& object) {
    if (!object.is_struct) return object.event_id ? ".Event" : ".Table";
    const bool is_vector = std::ranges::all_of(object.fields, [](const Field& field) {
      return field.type.base == BaseType::kFloat || field.type.base == BaseType::kDouble;
    });
    return is_vector ? ".Vector" : ".Struct";
  }

  std::string object_class(const Object& object) {
    const std::string base = names_.module("rtpm") + base_of(object);
    std::set<std::string> members;
    for (const Field& field : object.fields) {
      if (is_in_python(field)) members.insert(python_name(field.name));
    }
    names_.enter(std::move(members));
    Definition init{.head = "    def __init__", .parameters = {"self"}, .tail = " -> None: ..."};
    Documentation notes;
    std::string body;
    for (const Field& field : object.fields) {
      if (!is_in_python(field)) continue;
      if (!object.is_struct && init.parameters.size() == 1) init.parameters.emplace_back("*");
      const std::string name = python_name(field.name);
      const std::string none = may_be_none(object, field) ? " | None" : "";
      body += "    " + name + ": " + read_type(field.type) + none + '\n';
      init.parameters.push_back(name + ": " + given_type(field.type) + none +
                                (field.is_required ? "" : " = ..."));
      std::ranges::copy(line_of(name, field.documentation, quantity(field)),
                        std::back_inserter(notes));
    }
    if (!body.empty()) body += text_of(init);
    names_.leave();
    Documentation lines = object.documentation;
    emit::add_paragraph(lines, notes);
    return class_text(python_type_name(model_, object.name), base, lines, body);
  }

  static bool may_be_none(const Object& object, const Field& field) noexcept {
    const BaseType base = field.type.base;
    const bool is_reference = base == BaseType::kObject || base == BaseType::kUnion;
    if (base <= BaseType::kDouble) return field.is_optional;
    return is_reference && !field.is_required && !object.is_struct;
  }

  /// A value of the type `base`, which refers to the same enum or object as `type`.
  std::string one(BaseType base, const Type& type) {
    if (type.index) return names_.type(referred_name(model_, type));
    if (base == BaseType::kBool) return names_.builtin("bool");
    if (base == BaseType::kString) return names_.builtin("str");
    const bool is_real = base == BaseType::kFloat || base == BaseType::kDouble;
    return names_.builtin(is_real ? "float" : "int");
  }

  enum class Many { kBytes, kNumbers, kStructs, kList };
  [[nodiscard]] Many many_of(const Type& type) const {
    if (type.has_object()) {
      return model_.objects[*type.index].is_struct ? Many::kStructs : Many::kList;
    }
    if (type.base == BaseType::kArray) return Many::kNumbers;
    if (type.index || type.element == BaseType::kBool || type.element == BaseType::kString) {
      return Many::kList;
    }
    const bool is_byte = type.element == BaseType::kInt8 || type.element == BaseType::kUint8;
    return is_byte ? Many::kBytes : Many::kNumbers;
  }

  /// The type of an attribute.
  std::string read_type(const Type& type) {
    if (!type.is_many()) return one(type.base, type);
    const Many many = many_of(type);
    if (many == Many::kBytes) return names_.builtin("bytes");
    if (many == Many::kList) return names_.builtin("list") + '[' + one(type.element, type) + ']';
    if (many == Many::kNumbers && type.base == BaseType::kVector) {
      return names_.module("array") + ".array[" + one(type.element, type) + ']';
    }
    const std::string ctypes = names_.module("ctypes");
    if (many == Many::kStructs) return ctypes + ".Array[" + one(type.element, type) + ']';
    return ctypes + ".Array[" + ctypes + ".c_" + std::string(spelling_of(type.element)) + ']';
  }

  /// The type of an argument.
  std::string given_type(const Type& type) {
    if (!type.is_many()) return one(type.base, type);
    const Many many = many_of(type);
    const std::string buffer = many == Many::kList ? "" : " | " + names_.module("rtpm") + ".Buffer";
    if (many == Many::kBytes) return names_.builtin("bytes") + buffer;
    return names_.from("collections.abc", "Sequence") + '[' + one(type.element, type) + ']' +
           buffer;
  }

  std::string service_classes(const Service& service) {
    const std::string name = python_type_name(model_, service.name);
    Documentation lines = service.documentation;
    if (const std::string facts = priority_facts(service); !facts.empty()) {
      emit::add_paragraph(lines, {facts});
    }
    std::set<std::string> members;
    for (const Method& method : service.methods)
      members.insert(python_name(method.name));
    const std::string rtpm = names_.module("rtpm");
    std::string text;
    for (const bool is_async : {false, true}) {
      names_.enter(members);
      std::string body;
      for (const Method& method : service.methods) {
        if (body.ends_with("\"\"\"\n")) body += '\n';
        body += client_method(method, is_async);
      }
      names_.leave();
      const std::string kind = is_async ? "AsyncClient" : "Client";
      text += class_text(name + kind, rtpm + '.' + kind, lines, body);
    }
    names_.enter(std::move(members));
    std::string body;
    for (const Method& method : service.methods)
      body += servant_method(method);
    names_.leave();
    return text + class_text(name + "Servant", rtpm + ".Servant", lines, body);
  }

  std::vector<std::string> request_parameters(const Method& method) {
    if (method.request.kind == PayloadKind::kEmpty) return {"self"};
    return {"self", "request: " + payload_type(method.request), "/"};
  }

  std::string payload_type(const Payload& payload) {
    if (payload.kind == PayloadKind::kEmpty) return "None";
    return names_.type(model_.objects[payload.struct_index.value_or(payload.table)].name);
  }

  std::string client_method(const Method& method, bool is_async) {
    Definition head{.head = "    def " + python_name(method.name),
                    .parameters = request_parameters(method),
                    .tail = {}};
    head.parameters.insert(head.parameters.end(),
                           {"*", "priority: " + names_.builtin("int") + " | None = ...",
                            "deadline: " + names_.builtin("float") + " | None = ..."});
    std::string result = payload_type(method.reply);
    if (method.is_stream) {
      result = names_.module("rtpm") + (is_async ? ".AsyncStream[" : ".Stream[") + result + ']';
    } else if (is_async) {
      head.head.insert(4, "async ");
    }
    const std::string docs = docstring(emit::method_notes(model_, method), "        ");
    head.tail = " -> " + result + (docs.empty() ? ": ..." : ":");
    return text_of(head) + docs;
  }

  std::string servant_method(const Method& method) {
    const std::string result = payload_type(method.reply);
    const auto abc = [&](const char* name) {
      return names_.from("collections.abc", name) + '[' + result + ']';
    };
    const std::string either = method.is_stream ? abc("Iterator") + " | " + abc("AsyncIterator")
                                                : result + " | " + abc("Awaitable");
    return "    @" + names_.module("abc") + ".abstractmethod\n" +
           text_of({.head = "    def " + python_name(method.name),
                    .parameters = request_parameters(method),
                    .tail = " -> " + either + ": ..."});
  }

  const Model& model_;
  Names names_;
};

}  // namespace

std::string stub(const Model& model, const std::string& compiler_version) {
  return StubWriter(model).write(compiler_version);
}

}  // namespace rtpm::schema::python
