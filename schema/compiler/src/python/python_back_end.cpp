#include <string>
#include <utility>
#include <vector>

#include "emit/name_scope.hpp"
#include "emit/prose.hpp"
#include "python/python_writer.hpp"
#include "reading/foreign_text.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/python_names.hpp"
#include "rtpm/schema/schema_text.hpp"

namespace rtpm::schema {
namespace {

// Raised when a package `rtpm` must have more than before to load a generated file.
constexpr int kLevel = 1;

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
    return {{name + ".py", emit::utf_8(module_text(model))},
            {name + ".pyi", emit::utf_8(python::stub(model, version_))}};
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
    emit::NameScope scope("Python", errors);
    for (const Object& object : model.objects) {
      if (!is_in_python(object)) continue;
      scope.add(python_type_name(model, object.name), emit::described(object), object.location);
    }
    for (const Enum& enumeration : model.enums) {
      scope.add(python_type_name(model, enumeration.name), emit::described(enumeration),
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
      emit::NameScope scope("Python", errors);
      for (const Field& field : object.fields) {
        if (!is_in_python(field)) continue;
        scope.add(python_name(field.name), "field `" + field.name + '`', field.location);
      }
    }
    for (const Enum& enumeration : model.enums) {
      if (enumeration.is_union) continue;
      emit::NameScope scope("Python", errors);
      for (const EnumValue& value : enumeration.values)
        scope.add(python_name(value.name), "value `" + value.name + '`', value.location);
    }
    for (const Service& service : model.services) {
      emit::NameScope scope("Python", errors);
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
