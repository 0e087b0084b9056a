#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema::python {

/// The text of <stem>_rtpm.pyi: the classes of the file's types, events and services.
[[nodiscard]] std::string stub(const Model& model, const std::string& compiler_version);

/// The name of a type in the module generated for `file`, which declares it. That module knows only
/// the types of `file` and of the files that it includes.
[[nodiscard]] std::string name_in_module_of(const Model& model, const std::string& qualified_name,
                                            const std::string& file);

/// The first line of each generated file.
[[nodiscard]] std::string banner(const Model& model, const std::string& compiler_version);

/// `text` for a literal in triple quotation marks.
[[nodiscard]] std::string escaped(std::string_view text);

/// A docstring of lines as long as they may be; empty if there are none.
[[nodiscard]] std::string docstring(const Documentation& lines, const std::string& indent);

/// A function's head, on one line if it fits, with breaks as black sets them.
struct Definition {
  std::string head{};  ///< "    def set_force".
  std::vector<std::string> parameters{};
  std::string tail{};  ///< " -> None: ...".
};
[[nodiscard]] std::string text_of(const Definition& definition);

/// "Shape: TypeAlias = Plane | Sphere", with breaks as black sets them.
/// @param head  "Shape: TypeAlias = "
[[nodiscard]] std::string alternatives(const std::string& head,
                                       const std::vector<std::string>& types);

}  // namespace rtpm::schema::python
