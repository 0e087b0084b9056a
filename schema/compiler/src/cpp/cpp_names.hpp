#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/model.hpp"

/// The C++ names of a schema's declarations.
namespace rtpm::schema::cpp {

[[nodiscard]] bool is_keyword(std::string_view name) noexcept;

/// A method's name. C++ keywords, macros of C headers and names that the generated classes use
/// (`binding`, `interface`, `dispatch`, the class names) get a trailing underscore, as in flatc.
[[nodiscard]] std::string method_name(const Service& service, const Method& method);

/// The classes generated for an event's table, such as "lab.Touched".
struct EventNames {
  std::string descriptor{};  ///< Such as "lab.TouchedEvent", which has the constants.
  std::string supplier{};    ///< "lab.TouchedSupplier".
  std::string consumer{};    ///< "lab.TouchedConsumer".
};
/// For a table whose name ends with "Event", such as "lab.TouchedEvent", the names are
/// "lab.TouchedEventTraits", "lab.TouchedSupplier" and "lab.TouchedConsumer".
[[nodiscard]] EventNames event_names(const std::string& table);

/// The type that flatc generates: "::lab::Force" for "lab.Force".
[[nodiscard]] std::string type_name(const std::string& qualified_name);
/// The name of a field or enumerator as flatc writes it.
[[nodiscard]] std::string data_name(const std::string& name);
/// The C++ namespace: "lab::arms" for "lab.arms".
[[nodiscard]] std::string namespace_name(const std::string& namespace_with_dots);

/// A function declaration, to be formatted in lines of at most 100 columns.
struct Function {
  std::string lead{};  ///< Such as "[[nodiscard]] " or "virtual "; may be empty.
  std::string result{};
  std::string name{};
  std::vector<std::string> parameters{};  ///< At least one parameter.
  std::string tail{};                     ///< The text after the parentheses: " noexcept;".
};
[[nodiscard]] std::string function(const Function& function, std::string_view indent);

/// A string literal.
[[nodiscard]] std::string literal(std::string_view text);
/// A raw string literal with a delimiter that does not occur in the text.
[[nodiscard]] std::string raw_literal(const std::string& text);
/// `lines` as `///` comments.
[[nodiscard]] std::string comment(const Documentation& lines, std::string_view indent);

}  // namespace rtpm::schema::cpp
