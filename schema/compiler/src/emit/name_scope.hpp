#pragma once

#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/model.hpp"

/// Names of declarations in languages that spell them otherwise than schemas.
namespace rtpm::schema::emit {

/// The names of one scope, and the declarations that have them.
/// @ownership refers to the list of errors, which must outlive it
class NameScope {
 public:
  /// @param language  "Python"
  NameScope(std::string language, Diagnostics& errors)
      : language_(std::move(language)), errors_(errors) {}

  /// Reports an error if the scope has the name already.
  /// @param what  "field `from_`"
  void add(const std::string& name, std::string what, const Location& place);

 private:
  std::string language_;
  Diagnostics& errors_;
  std::map<std::string, std::pair<std::string, Location>> names_{};
};

/// "struct `lab.Force`", "table …", "enum …", "union …".
[[nodiscard]] std::string described(const Object& object);
[[nodiscard]] std::string described(const Enum& enumeration);

/// "getPosition" for "get_position" and "GetPosition".
[[nodiscard]] std::string camel(std::string_view name);
/// "FREE_MOTION" for "FreeMotion" and "free_motion".
[[nodiscard]] std::string upper_snake(std::string_view name);

}  // namespace rtpm::schema::emit
