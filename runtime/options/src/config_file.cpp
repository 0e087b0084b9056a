#include "config_file.hpp"

#include <toml++/toml.h>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>

#include "rtpm/base/utf8_path.hpp"
#include "rtpm/options/toml_limits.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::options {
namespace {

expected<std::string, SetupError> read_text(const std::string& path) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::string text(kTomlSizeMax + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  const bool is_read = file.is_open() && !file.bad();
  if (is_read && text.size() <= kTomlSizeMax) return text;
  const std::string cause = is_read ? "it is larger than 1 MiB" : std::strerror(errno);
  std::error_code ignored;
  // Systems differ in what they say of one.
  const bool is_directory = std::filesystem::is_directory(path_of_utf8(path), ignored);
  return setup_error("cannot read the configuration file '" + path + "'",
                     is_directory ? "it is a directory" : cause);
}

/// A value as the text that an option reads.
std::string text_of(const toml::node& node) {
  return node.visit([](const auto& value) -> std::string {
    if constexpr (toml::is_string<decltype(value)>) return value.get();
    if constexpr (toml::is_boolean<decltype(value)>) return value.get() ? "true" : "false";
    if constexpr (toml::is_integer<decltype(value)>) return std::to_string(value.get());
    if constexpr (toml::is_floating_point<decltype(value)>)
      return program::formatted("%.17g", value.get());
    return "a date or time";
  });
}

/// Turns one file's nodes into entries.
struct Reader {
  std::string file;
  std::vector<std::pair<toml::source_position, ConfigEntry>> entries{};
  std::string failure{};

  [[nodiscard]] std::string place(const toml::source_position& at) const {
    return file + ":" + std::to_string(at.line) + ":" + std::to_string(at.column);
  }

  void add_table(const toml::table& table, const std::vector<std::string>& path) {
    for (const auto& [key, node] : table) {
      std::vector<std::string> own = path;
      own.emplace_back(key.str());
      const bool is_table = node.is_table();
      const toml::source_position at = (is_table ? key.source() : node.source()).begin;
      ConfigEntry& entry =
          entries.emplace_back(at, ConfigEntry{own, {}, is_table, place(at)}).second;
      if (is_table) {
        add_table(*node.as_table(), own);
      } else if (const toml::array* const list = node.as_array()) {
        for (const toml::node& item : *list) {
          if (item.is_table() || item.is_array())
            failure =
                place(item.source().begin) + ": " + own.back() + " is a list of tables or lists";
          entry.texts.push_back(text_of(item));
        }
      } else {
        entry.texts.push_back(text_of(node));
      }
    }
  }
};

/// The table `config` of the program of that name, or null; nothing if there is no such program.
std::optional<const toml::table*> config_of_program(const toml::table& file,
                                                    const std::string& name) {
  const toml::array* const programs = file["program"].as_array();
  if (programs == nullptr) return std::nullopt;
  for (const toml::node& program : *programs) {
    const toml::table* const table = program.as_table();
    if (table != nullptr && (*table)["name"].value_or(std::string{}) == name)
      return (*table)["config"].as_table();
  }
  return std::nullopt;
}

}  // namespace

expected<std::vector<ConfigEntry>, SetupError> read_config_file(const std::string& name) {
  const std::size_t mark = std::min(name.find('#'), name.size());
  Reader reader{.file = name.substr(0, mark)};
  const auto text = read_text(reader.file);
  if (!text) return unexpected{text.error()};
  if (may_nest_too_deeply(*text)) return setup_error(reader.file + ": its tables nest too deeply");
  const toml::parse_result parsed = toml::parse(*text);
  if (!parsed) {
    return setup_error(reader.place(parsed.error().source().begin) + ": " +
                       std::string(parsed.error().description()));
  }
  std::optional<const toml::table*> table = &parsed.table();
  if (mark < name.size()) table = config_of_program(parsed.table(), name.substr(mark + 1));
  if (!table) {
    return setup_error(reader.file + ": no [[program]] has the name '" + name.substr(mark + 1) +
                       "'");
  }
  if (*table != nullptr) reader.add_table(**table, {});
  if (!reader.failure.empty()) return setup_error(reader.failure);
  std::ranges::stable_sort(reader.entries, {}, [](const auto& entry) { return entry.first; });
  std::vector<ConfigEntry> entries;
  for (auto& [at, entry] : reader.entries)
    entries.push_back(std::move(entry));
  return entries;
}

}  // namespace rtpm::options
