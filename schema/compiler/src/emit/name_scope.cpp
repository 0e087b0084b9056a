#include "emit/name_scope.hpp"

#include <cstddef>
#include <optional>

namespace rtpm::schema::emit {
namespace {

bool is_lower_or_digit(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
}
bool is_upper(char c) noexcept {
  return c >= 'A' && c <= 'Z';
}
char lower(char c) noexcept {
  return is_upper(c) ? static_cast<char>(c - 'A' + 'a') : c;
}
char upper(char c) noexcept {
  return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
}

}  // namespace

void NameScope::add(const std::string& name, std::string what, const Location& place) {
  const auto [other, is_new] = names_.try_emplace(name, std::move(what), place);
  if (is_new) return;
  std::string text = what + " becomes `" + name + "` in ";
  text += language_ + ", as " + other->second.first + " does";
  Diagnostic error{place, std::move(text), "rename one of the two", std::nullopt};
  if (other->second.second.line != 0) error.note = Note{other->second.second, "the other is here"};
  errors_.push_back(std::move(error));
}

std::string described(const Object& object) {
  return (object.is_struct ? "struct `" : "table `") + object.name + '`';
}

std::string described(const Enum& enumeration) {
  return (enumeration.is_union ? "union `" : "enum `") + enumeration.name + '`';
}

std::string camel(std::string_view name) {
  std::string result;
  bool begins_word = false;
  for (const char c : name) {
    if (c == '_') {
      // Names that begin with underscores keep them.
      if (result.empty() || result.find_first_not_of('_') == std::string::npos) result += '_';
      begins_word = true;
    } else {
      const bool is_first = result.find_first_not_of('_') == std::string::npos;
      result += is_first ? lower(c) : begins_word ? upper(c) : c;
      begins_word = false;
    }
  }
  if (name.ends_with('_') && result.find_first_not_of('_') != std::string::npos) result += '_';
  return result;
}

std::string upper_snake(std::string_view name) {
  std::string result;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool begins_word =
        i > 0 && is_upper(name[i]) &&
        (is_lower_or_digit(name[i - 1]) || (is_upper(name[i - 1]) && i + 1 < name.size() &&
                                            name[i + 1] >= 'a' && name[i + 1] <= 'z'));
    if (begins_word) result += '_';
    result += upper(name[i]);
  }
  return result;
}

}  // namespace rtpm::schema::emit
