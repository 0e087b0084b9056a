#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/model.hpp"

/// How names of a schema are written in C++.
namespace rtpm::schema::cpp {

[[nodiscard]] bool is_keyword(std::string_view name) noexcept;

/// A method's name. A C++ keyword and a name that the generated classes need themselves (`binding`,
/// `interface`, `dispatch`, the classes' own) get an underscore behind, as flatc does
/// it.
[[nodiscard]] std::string method_name(const Service& service, const Method& method);

/// What the table of an event, "lab.Touched", becomes besides its data type.
struct EventNames {
  std::string descriptor{};  ///< "lab.TouchedEvent", which has its constants.
  std::string supplier{};    ///< "lab.TouchedSupplier".
  std::string consumer{};    ///< "lab.TouchedConsumer".
};
/// A table that is called an event already is not called so twice: "lab.TouchedEvent" becomes
/// "lab.TouchedEventTraits", "lab.TouchedSupplier" and "lab.TouchedConsumer".
[[nodiscard]] EventNames event_names(const std::string& table);

/// "::lab::Force" of "lab.Force", the type that flatc generates.
[[nodiscard]] std::string type_name(const std::string& qualified_name);
/// A name of a field, or of an enumeration's value, as flatc writes it.
[[nodiscard]] std::string data_name(const std::string& name);
/// "lab::arms" of "lab.arms".
[[nodiscard]] std::string namespace_name(const std::string& namespace_with_dots);

/// The head of a function, to be laid out in lines of at most 100 columns.
struct Function {
  std::string lead{};  ///< "[[nodiscard]] ", "virtual " or nothing.
  std::string result{};
  std::string name{};
  std::vector<std::string> parameters{};  ///< At least one.
  std::string tail{};                     ///< What follows the parentheses: " noexcept;".
};
[[nodiscard]] std::string function(const Function& function, std::string_view indent);

/// A number as C++ takes it: "0x00c0ffee".
[[nodiscard]] std::string hexadecimal(std::uint64_t value, std::size_t digits);
/// A string literal.
[[nodiscard]] std::string literal(std::string_view text);
/// `lines` as `///` comments behind `indent`.
[[nodiscard]] std::string comment(const Documentation& lines, std::string_view indent);

}  // namespace rtpm::schema::cpp
