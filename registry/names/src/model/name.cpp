#include "model/name.hpp"

#include <algorithm>

#include "rtpm/base/printable.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::names {
namespace {

// Not <cctype>, which depends on the locale.
constexpr bool is_letter(char character) noexcept {
  return (character >= 'a' && character <= 'z') || (character >= 'A' && character <= 'Z');
}
constexpr bool is_digit(char character) noexcept {
  return character >= '0' && character <= '9';
}
constexpr bool is_name_character(char character) noexcept {
  return is_letter(character) || is_digit(character) || character == '.' || character == '_' ||
         character == '-';
}

bool is_identifier(std::string_view text) noexcept {
  return !text.empty() && !is_digit(text.front()) &&
         std::all_of(text.begin(), text.end(), [](char character) {
           return is_letter(character) || is_digit(character) || character == '_';
         });
}

}  // namespace

std::string quoted(std::string_view text) {
  return "'" + printable(text) + "'";
}

std::optional<std::uint8_t> first_bad_component(std::string_view name) noexcept {
  std::size_t begin = 0;
  for (std::uint8_t index = 0; index < kNameDepthMax; ++index) {
    const std::size_t end = std::min(name.find('/', begin), name.size());
    const std::string_view component = name.substr(begin, end - begin);
    if (component.empty() || component.size() > kComponentSizeMax || end > kNameSizeMax ||
        !std::all_of(component.begin(), component.end(), is_name_character)) {
      return index;
    }
    if (end == name.size()) return std::nullopt;
    begin = end + 1;
  }
  return static_cast<std::uint8_t>(kNameDepthMax);
}

bool is_url(std::string_view url) {
  return url.size() <= kUrlSizeMax && wire::parse_url(url).has_value();
}

bool is_interface(std::string_view interface) noexcept {
  if (interface.size() > kInterfaceSizeMax) return false;
  for (;;) {
    const std::size_t dot = interface.find('.');
    if (!is_identifier(interface.substr(0, dot))) return false;
    if (dot == std::string_view::npos) return true;
    interface.remove_prefix(dot + 1);
  }
}

std::string_view component_of(std::string_view name, std::size_t index) noexcept {
  for (; index > 0; --index) {
    const std::size_t slash = name.find('/');
    if (slash == std::string_view::npos) return {};
    name.remove_prefix(slash + 1);
  }
  return name.substr(0, name.find('/'));
}

}  // namespace rtpm::names
