#include "rtpm/schema/python_names.hpp"

#include <algorithm>
#include <cctype>
#include <functional>
#include <iterator>

#include "python/python_writer.hpp"

namespace rtpm::schema {
namespace {

// Python's keywords, `self`, and `mro`, which no enumeration may have as a member.
constexpr std::string_view kReserved[] = {
    "False",   "None",  "True",     "and",    "as",    "assert", "async", "await",
    "break",   "class", "continue", "def",    "del",   "elif",   "else",  "except",
    "finally", "for",   "from",     "global", "if",    "import", "in",    "is",
    "lambda",  "mro",   "nonlocal", "not",    "or",    "pass",   "raise", "return",
    "self",    "try",   "while",    "with",   "yield",
};
static_assert(std::is_sorted(std::begin(kReserved), std::end(kReserved)));

using FilePredicate = std::function<bool(const std::string&)>;

/// The class of a type in a module with the types of the files that `is_known` accepts.
std::string name_among(const Model& model, const std::string& qualified_name,
                       const FilePredicate& is_known) {
  const std::string name = short_name(qualified_name);
  const auto clashes = [&](const auto& type) {
    return is_known(type.declaration_file) && type.name != qualified_name &&
           type.name.ends_with(name) && short_name(type.name) == name;
  };
  const bool is_shared = std::ranges::any_of(model.enums, clashes) ||
                         std::ranges::any_of(model.objects, [&](const Object& object) {
                           return is_in_python(object) && clashes(object);
                         });
  if (!is_shared) return python_name(name);
  std::string whole = qualified_name;
  std::ranges::replace(whole, '.', '_');
  return python_name(whole);
}

}  // namespace

std::string python_name(std::string_view name) {
  const bool is_special = name.size() > 1 && name.front() == '_' && name.back() == '_';
  const bool is_reserved = std::binary_search(std::begin(kReserved), std::end(kReserved), name);
  return std::string(name) + (is_special || is_reserved ? "_" : "");
}

std::string python_type_name(const Model& model, const std::string& qualified_name) {
  const auto has_name = [&](const Service& service) { return service.name == qualified_name; };
  if (!std::ranges::any_of(model.services, has_name)) {
    return name_among(model, qualified_name, [](const std::string&) { return true; });
  }
  const std::string name = short_name(qualified_name);
  const bool is_shared = std::ranges::count(model.services, name, [](const Service& service) {
                           return short_name(service.name);
                         }) > 1;
  std::string whole = is_shared ? qualified_name : name;
  std::ranges::replace(whole, '.', '_');
  return whole;
}

std::string python::name_in_module_of(const Model& model, const std::string& qualified_name,
                                      const std::string& file) {
  const auto found = model.included_files.find(file);
  return name_among(model, qualified_name, [&](const std::string& other) {
    return other == file || (found != model.included_files.end() && found->second.contains(other));
  });
}

std::string python_module_name(std::string_view file_stem) {
  std::string name(file_stem);
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  if (!name.empty() && std::isdigit(static_cast<unsigned char>(name.front())) != 0) {
    name.insert(0, 1, '_');
  }
  return name + "_rtpm";
}

bool is_in_python(const Field& field) noexcept {
  return !field.is_deprecated && field.type.innermost() != BaseType::kUnionType;
}

bool is_in_python(const Object& object) noexcept {
  return object.name != "rtpm.Empty";
}

}  // namespace rtpm::schema
