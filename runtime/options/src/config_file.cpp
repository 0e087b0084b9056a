#include "config_file.hpp"

#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>

namespace rtpm::options {
namespace {

constexpr std::string_view kBlanks = " \t\r";

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

/// The text before a comment: before a `#` at the beginning or after a blank.
std::string_view without_comment(std::string_view text) {
  for (std::size_t at = text.find('#'); at != std::string_view::npos; at = text.find('#', at + 1)) {
    if (at == 0 || kBlanks.find(text[at - 1]) != std::string_view::npos) return text.substr(0, at);
  }
  return text;
}

/// Takes one escape sequence, without its backslash, from the beginning of `text`.
std::optional<char> take_escaped(std::string_view& text) {
  if (text.starts_with('\\') || text.starts_with('"')) {
    const char character = text.front();
    text.remove_prefix(1);
    return character;
  }
  unsigned char byte = 0;
  if (text.size() < 3 || text.front() != 'x') return std::nullopt;
  const auto read = std::from_chars(text.data() + 1, text.data() + 3, byte, 16);
  if (read.ec != std::errc{} || read.ptr != text.data() + 3) return std::nullopt;
  text.remove_prefix(3);
  return static_cast<char>(byte);
}

/// The value that begins with a quote, or its fault.
expected<std::string, SetupError> unquoted(std::string_view text) {
  text.remove_prefix(1);
  std::string value;
  while (!text.empty() && text.front() != '"') {
    char character = text.front();
    text.remove_prefix(1);
    if (character == '\\') {
      const std::optional<char> escaped = take_escaped(text);
      if (!escaped)
        return unexpected{SetupError{R"(knows only \\, \" and \xNN after a backslash)"}};
      character = *escaped;
    }
    value += character;
  }
  if (text.empty()) return unexpected{SetupError{"has no closing quote"}};
  text.remove_prefix(1);
  if (!trimmed(without_comment(text)).empty()) {
    return unexpected{SetupError{"goes on after the closing quote"}};
  }
  return value;
}

expected<ConfigLine, SetupError> parse_line(std::string_view text, int line) {
  const std::size_t equals = text.find('=');
  const std::string_view key = trimmed(text.substr(0, equals));
  if (equals == std::string_view::npos || key.empty()) {
    return unexpected{SetupError{"is not 'key = value'"}};
  }
  const std::string_view rest = trimmed(text.substr(equals + 1));
  if (rest.starts_with('"')) {
    auto value = unquoted(rest);
    if (!value) return unexpected{std::move(value.error())};
    return ConfigLine{std::string(key), std::move(*value), line};
  }
  return ConfigLine{std::string(key), std::string(trimmed(without_comment(rest))), line};
}

expected<std::string, SetupError> read_text(const std::string& path) {
  const auto fail = [&](const char* cause) {
    return unexpected{SetupError{"cannot read the configuration file '" + path + "': " + cause}};
  };
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "re"),
                                                             &std::fclose);
  if (file == nullptr) return fail(std::strerror(errno));
  std::string text;
  std::array<char, 4096> buffer{};
  while (const std::size_t size = std::fread(buffer.data(), 1, buffer.size(), file.get())) {
    text.append(buffer.data(), size);
    if (text.size() > kConfigSizeMax) return fail("it is larger than 1 MiB");
  }
  if (std::ferror(file.get()) != 0) return fail(std::strerror(errno));
  return text;
}

}  // namespace

expected<std::vector<ConfigLine>, SetupError> read_config_file(const std::string& path) {
  const auto text = read_text(path);
  if (!text) return unexpected{text.error()};
  std::vector<ConfigLine> lines;
  std::string_view rest = *text;
  for (int number = 1; !rest.empty(); ++number) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view line = trimmed(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (line.empty() || line.front() == '#') continue;
    auto parsed = parse_line(line, number);
    if (!parsed) {
      return unexpected{SetupError{path + ":" + std::to_string(number) + ": '" + std::string(line) +
                                   "' " + parsed.error().reason()}};
    }
    lines.push_back(std::move(*parsed));
  }
  return lines;
}

std::string config_value_text(std::string_view value) {
  const auto is_control = [](char character) {
    const auto byte = static_cast<unsigned char>(character);
    return byte < 0x20 || byte == 0x7f;
  };
  bool needs_quotes =
      value.find_first_of("#\"\\") != std::string_view::npos || value != trimmed(value);
  for (const char character : value)
    needs_quotes = needs_quotes || is_control(character);
  if (!needs_quotes) return std::string(value);

  std::string quoted = "\"";
  for (const char character : value) {
    if (is_control(character)) {
      constexpr std::string_view kDigits = "0123456789abcdef";
      const auto byte = static_cast<unsigned char>(character);
      quoted += {'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15]};
    } else {
      if (character == '"' || character == '\\') quoted += '\\';
      quoted += character;
    }
  }
  return quoted + '"';
}

}  // namespace rtpm::options
