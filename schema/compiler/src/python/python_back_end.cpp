#include <flatbuffers/util.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "python/python_writer.hpp"
#include "reading/foreign_text.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/python_names.hpp"
#include "rtpm/schema/schema_text.hpp"

namespace rtpm::schema {
namespace {

// Raised when a package `rtpm` must have more than before to load a generated file.
constexpr int kLevel = 1;

/// The names of one scope, and the declarations that have them.
class Scope {
 public:
  explicit Scope(Diagnostics& errors) : errors_(errors) {}

  /// @param what  "field `from_`"
  void add(const std::string& name, std::string what, const Location& place) {
    const auto [other, is_new] = names_.try_emplace(name, std::move(what), place);
    if (is_new) return;
    Diagnostic error{
        place, what + " becomes `" + name + "` in Python, as " + other->second.first + " does",
        "rename one of the two", std::nullopt};
    if (other->second.second.line != 0)
      error.note = Note{other->second.second, "the other is here"};
    errors_.push_back(std::move(error));
  }

 private:
  Diagnostics& errors_;
  std::map<std::string, std::pair<std::string, Location>> names_{};
};

/// `text` as UTF-8, which Python requires of its files and FlatBuffers not of comments.
std::string utf_8(const std::string& text) {
  std::string result;
  const char* const end = text.c_str() + text.size();
  for (const char* at = text.c_str(); at != end;) {
    const char* const begin = at;
    if (flatbuffers::FromUTF8(&at) >= 0) {
      result.append(begin, at);
    } else {
      result += "\xEF\xBF\xBD";  // U+FFFD, for one byte.
      at = begin + 1;
    }
  }
  return result;
}

class PythonBackEnd final : public BackEnd {
 public:
  explicit PythonBackEnd(std::string compiler_version) : version_(std::move(compiler_version)) {}

  [[nodiscard]] Diagnostics check(const Model& model) const override {
    Diagnostics errors;
    check_classes(model, errors);
    check_members(model, errors);
    const SourceFile text(model.file, schema_text(model));
    if (const auto refusal = refuse_foreign(text)) {
      errors.push_back({Location{.file = model.file},
                        "Python can't load the schema: " + refusal->message,
                        "split the schema, or remove what is refused", std::nullopt});
    }
    return errors;
  }

  [[nodiscard]] std::vector<GeneratedFile> generate(const Model& model) const override {
    const std::string name = python_module_name(model.file_stem);
    return {{name + ".py", utf_8(module_text(model))},
            {name + ".pyi", utf_8(python::stub(model, version_))}};
  }

 private:
  [[nodiscard]] std::string module_text(const Model& model) const {
    return python::banner(model, version_) + "\"\"\"The types, events and services of " +
           model.file_stem +
           ".fbs.\"\"\"\n\nfrom rtpm.generated import load as _load\n\n"
           "_load(\n    __name__,\n    level=" +
           std::to_string(kLevel) + ",\n    schema=\"\"\"\\\n" +
           python::escaped(schema_text(model)) + "\"\"\",\n)\n";
  }

  /// Included types take part: the module has their names, too.
  static void check_classes(const Model& model, Diagnostics& errors) {
    Scope scope(errors);
    for (const Object& object : model.objects) {
      if (!is_in_python(object)) continue;
      scope.add(python_type_name(model, object.name),
                (object.is_struct ? "struct `" : "table `") + object.name + '`', object.location);
    }
    for (const Enum& enumeration : model.enums) {
      scope.add(python_type_name(model, enumeration.name),
                (enumeration.is_union ? "union `" : "enum `") + enumeration.name + '`',
                enumeration.location);
    }
    for (const Service& service : model.services) {
      for (const char* suffix : {"Client", "AsyncClient", "Servant"}) {
        scope.add(python_type_name(model, service.name) + suffix, "service `" + service.name + '`',
                  service.location);
      }
    }
  }

  static void check_members(const Model& model, Diagnostics& errors) {
    for (const Object& object : model.objects) {
      Scope scope(errors);
      for (const Field& field : object.fields) {
        if (!is_in_python(field)) continue;
        scope.add(python_name(field.name), "field `" + field.name + '`', field.location);
      }
    }
    for (const Enum& enumeration : model.enums) {
      if (enumeration.is_union) continue;
      Scope scope(errors);
      for (const EnumValue& value : enumeration.values)
        scope.add(python_name(value.name), "value `" + value.name + '`', value.location);
    }
    for (const Service& service : model.services) {
      Scope scope(errors);
      for (const Method& method : service.methods)
        scope.add(python_name(method.name), "method `" + method.name + '`', method.location);
    }
  }

  std::string version_;
};

}  // namespace

std::unique_ptr<BackEnd> make_python_back_end(std::string compiler_version) {
  return std::make_unique<PythonBackEnd>(std::move(compiler_version));
}

}  // namespace rtpm::schema
