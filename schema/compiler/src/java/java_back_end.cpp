#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "emit/name_scope.hpp"
#include "java/java_names.hpp"
#include "java/java_writer.hpp"
#include "rtpm/schema/back_end.hpp"

namespace rtpm::schema {
namespace {

using java::Names;

class JavaBackEnd final : public BackEnd {
 public:
  explicit JavaBackEnd(std::string compiler_version) : version_(std::move(compiler_version)) {}

  [[nodiscard]] Diagnostics check(const Model& model) const override {
    Diagnostics errors;
    const Names names(model);
    check_classes(model, names, errors);
    check_members(model, names, errors);
    return errors;
  }

  [[nodiscard]] std::vector<GeneratedFile> generate(const Model& model) const override {
    const Names names(model);
    java::Context context{model, names, version_, {}};
    const auto is_own = [&](const auto& type) {
      return type.declaration_file == model.declaration_file;
    };
    std::vector<GeneratedFile> files;
    for (const Enum& enumeration : model.enums) {
      if (!is_own(enumeration)) continue;
      // The members of a union hide types of the same name.
      context.package =
          enumeration.is_union ? "" : names.package_of(enumeration.name, model.declaration_file);
      files.push_back(enumeration.is_union ? java::union_file(context, enumeration)
                                           : java::enum_file(context, enumeration));
    }
    for (std::size_t i = 0; i < model.objects.size(); ++i) {
      const Object& object = model.objects[i];
      if (!is_own(object) || !java::is_shown(object)) continue;
      context.package = names.package_of(object.name, model.declaration_file);
      files.push_back(object.is_struct ? java::struct_file(context, object)
                                       : java::table_file(context, i));
    }
    for (const Service& service : model.services) {
      context.package = names.package_of(service.name, model.declaration_file);
      for (GeneratedFile& file : java::service_files(context, service))
        files.push_back(std::move(file));
    }
    return files;
  }

 private:
  static void check_classes(const Model& model, const Names& names, Diagnostics& errors) {
    emit::NameScope scope("Java", errors);
    for (const Object& object : model.objects) {
      if (java::is_shown(object)) {
        scope.add(names.whole(object), emit::described(object), object.location);
      }
    }
    for (const Enum& enumeration : model.enums)
      scope.add(names.whole(enumeration), emit::described(enumeration), enumeration.location);
    for (const Service& service : model.services) {
      const std::string stem =
          names.package_of(service.name, model.declaration_file) + '.' + short_name(service.name);
      for (const char* suffix : {"Client", "Methods", "Servant"})
        scope.add(stem + suffix, "service `" + service.name + '`', service.location);
    }
  }

  /// A constructor takes 255 words; it has `this`, and a number of 8 bytes counts twice.
  static void check_size(const Object& object, Diagnostics& errors) {
    std::size_t word_count = 1;
    for (const Field& field : object.fields) {
      if (!java::is_shown(field)) continue;
      const bool is_long = field.type.base >= BaseType::kUint32 &&
                           field.type.base <= BaseType::kDouble &&
                           field.type.base != BaseType::kFloat;
      word_count += is_long && !field.is_optional ? 2U : 1U;
    }
    if (word_count <= 255) return;
    errors.push_back({object.location,
                      emit::described(object) + " has more fields than a record of Java takes",
                      "nest some of them in a table of their own", std::nullopt});
  }

  static void check_members(const Model& model, const Names& names, Diagnostics& errors) {
    for (const Object& object : model.objects) {
      check_size(object, errors);
      emit::NameScope scope("Java", errors);
      for (const Field& field : object.fields) {
        if (!java::is_shown(field)) continue;
        scope.add(names.member(field.name), "field `" + field.name + '`', field.location);
      }
    }
    for (const Enum& enumeration : model.enums) {
      emit::NameScope scope("Java", errors);
      for (const EnumValue& value : enumeration.values) {
        scope.add(enumeration.is_union ? names.type(value.name) : Names::constant(value.name),
                  "value `" + value.name + '`', value.location);
      }
    }
    for (const Service& service : model.services) {
      emit::NameScope members("Java", errors);
      emit::NameScope constants("Java", errors);
      for (const Method& method : service.methods) {
        const std::string what = "method `" + method.name + '`';
        members.add(names.member(method.name), what, method.location);
        constants.add(Names::constant(method.name), what, method.location);
      }
    }
  }

  std::string version_;
};

}  // namespace

std::unique_ptr<BackEnd> make_java_back_end(std::string compiler_version) {
  return std::make_unique<JavaBackEnd>(std::move(compiler_version));
}

}  // namespace rtpm::schema
