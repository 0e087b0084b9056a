#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace rtpm::schema {

/// Writes JSON for people and machines: two spaces a level, members in the order of the calls.
/// Texts are written as they are, which is UTF-8 if the schema is.
class JsonWriter {
 public:
  /// Begins an object or array, as a member `name`, or unnamed as an array's element or the root.
  JsonWriter& object(std::string_view name = {}) { return open(name, '{'); }
  JsonWriter& array(std::string_view name = {}) { return open(name, '['); }
  /// Ends the innermost object or array.
  JsonWriter& end();

  JsonWriter& text(std::string_view name, std::string_view value);
  JsonWriter& number(std::string_view name, std::int64_t value);
  JsonWriter& number(std::string_view name, double value);
  JsonWriter& boolean(std::string_view name, bool value);

  /// All that was written, ending with a new line.
  [[nodiscard]] std::string take();

 private:
  JsonWriter& open(std::string_view name, char bracket);
  void begin_value(std::string_view name);

  std::string text_{};
  std::string closers_{};  // What ends the objects and arrays that are open.
  bool is_first_ = true;   // In the innermost of them.
};

}  // namespace rtpm::schema
