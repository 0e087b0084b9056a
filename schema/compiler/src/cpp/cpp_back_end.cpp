#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cpp/cpp_macros.hpp"
#include "cpp/cpp_names.hpp"
#include "cpp/cpp_writer.hpp"
#include "model/words.hpp"
#include "rtpm/schema/back_end.hpp"

namespace rtpm::schema {
namespace {

using cpp::method_name;

class CppBackEnd final : public BackEnd {
 public:
  explicit CppBackEnd(std::string compiler_version) : version_(std::move(compiler_version)) {}

  [[nodiscard]] Diagnostics check(const Model& model) const override {
    Diagnostics errors;
    for (const NamespaceName& name : model.namespaces) {
      if (cpp::is_keyword(name.name)) {
        errors.push_back({name.location, "namespace `" + name.name + "` is a keyword of C++",
                          "choose another name: flatc's own code would not compile either",
                          std::nullopt});
      }
      check_macro("namespace", name.name, name.location, errors);
    }
    check_data_names(model, errors);
    check_events(model, errors);
    for (const Service& service : model.services) {
      check_classes(model, service, errors);
      check_members(service, errors);
    }
    return errors;
  }

  [[nodiscard]] std::vector<GeneratedFile> generate(const Model& model) const override {
    return {{model.file_stem + ".rtpm.hpp", cpp::header(model, version_)},
            {model.file_stem + ".rtpm.functions.hpp", cpp::functions_header(model, version_)},
            {model.file_stem + ".rtpm.events.hpp", cpp::events_header(model, version_)},
            {model.file_stem + ".rtpm.cpp", cpp::source(model, version_)}};
  }

 private:
  /// Refuses macros as names of data, because flatc does not change these names.
  static void check_macro(const char* kind, const std::string& name, const Location& place,
                          Diagnostics& errors) {
    if (!cpp::is_macro(name)) return;
    errors.push_back(
        {place, std::string(kind) + " `" + name + "` is a name that C++ compilers and headers keep",
         "choose another name: flatc's code would not compile", std::nullopt});
  }

  static void check_data_names(const Model& model, Diagnostics& errors) {
    for (const Object& object : model.objects) {
      check_macro(object.is_struct ? "struct" : "table", short_name(object.name), object.location,
                  errors);
      for (const Field& field : object.fields)
        check_macro("field", field.name, field.location, errors);
    }
    for (const Enum& enumeration : model.enums) {
      check_macro(enumeration.is_union ? "union" : "enum", short_name(enumeration.name),
                  enumeration.location, errors);
      for (const EnumValue& value : enumeration.values)
        check_macro("value", value.name, value.location, errors);
    }
  }

  /// Checks that a class generated for a service or event is not also a data type of the schema.
  /// @param what  "service `lab.Arm`", declared at `place`
  static void check_class(const Model& model, const std::string& what, const std::string& remedy,
                          const Location& place, const std::string& name, Diagnostics& errors) {
    const auto report = [&](const std::string& kind, const Location& other) {
      Diagnostic error{place,
                       what + " becomes the class `" + short_name(name) + "`, which is " +
                           with_article(kind) + " of the schema too",
                       "rename the " + remedy + " or the " + kind, std::nullopt};
      if (other.line != 0) error.note = Note{other, "the " + kind + " is here"};
      errors.push_back(std::move(error));
    };
    for (const Object& object : model.objects) {
      if (object.name == name) report(object.is_struct ? "struct" : "table", object.location);
    }
    for (const Enum& enumeration : model.enums) {
      if (enumeration.name == name)
        report(enumeration.is_union ? "union" : "enum", enumeration.location);
    }
  }

  static void check_classes(const Model& model, const Service& service, Diagnostics& errors) {
    for (const char* suffix : {"Client", "Servant", "MethodId", "Functions", "FunctionServant"}) {
      check_class(model, "service `" + service.name + '`', "service", service.location,
                  service.name + suffix, errors);
    }
  }

  /// Also checks the events of included files: their classes may clash with this file's types.
  static void check_events(const Model& model, Diagnostics& errors) {
    std::map<std::string, const Object*> classes;
    for (const Object& object : model.objects) {
      if (!object.event_id) continue;
      const cpp::EventNames names = cpp::event_names(object.name);
      bool is_free = true;
      for (const std::string& name : {names.descriptor, names.supplier, names.consumer}) {
        const std::size_t error_count = errors.size();
        check_class(model, "event `" + object.name + '`', "event", object.location, name, errors);
        const auto [other, is_new] = classes.emplace(name, &object);
        // A pair that shares several names is reported only once.
        if (!is_new && is_free) {
          errors.push_back({object.location,
                            "event `" + object.name + "` becomes the class `" + short_name(name) +
                                "`, as event `" + other->second->name + "` does",
                            "rename one of the two",
                            Note{other->second->location, "the other event is here"}});
        }
        is_free = is_free && errors.size() == error_count;
      }
    }
  }

  /// Checks that no two methods get the same member name, because of an underscore or `_encoded`.
  static void check_members(const Service& service, Diagnostics& errors) {
    std::map<std::string, const Method*> members;
    std::set<std::pair<const Method*, const Method*>> reported;
    for (const Method& method : service.methods)
      members.emplace(method.name, &method);
    const auto check = [&](const Method& method, const std::string& member) {
      const auto [other, is_new] = members.emplace(member, &method);
      if (is_new || other->second == &method) return;
      // A pair that shares several names is reported only once.
      if (!reported.insert(std::minmax({other->second, &method})).second) return;
      errors.push_back(
          {other->second->location,
           "method `" + other->second->name + "` has the name that `" + method.name +
               "` gets in C++",
           "rename one of the two",
           Note{method.location, "`" + method.name + "` gets the name `" + member + "`, too"}});
    };
    for (const Method& method : service.methods) {
      const std::string name = method_name(service, method);
      check(method, name);
      const bool is_table = method.request.kind == PayloadKind::kTable;
      if (is_table) check(method, name + "_encoded");
      if (!cpp::can_begin(method)) continue;
      check(method, cpp::begin_name(method));
      if (is_table) check(method, cpp::begin_name(method) + "_encoded");
    }
  }

  std::string version_;
};

}  // namespace

std::unique_ptr<BackEnd> make_cpp_back_end(std::string compiler_version) {
  return std::make_unique<CppBackEnd>(std::move(compiler_version));
}

}  // namespace rtpm::schema
