#include "config_file.hpp"

#include <toml++/toml.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <sstream>
#include <utility>

#include "rtpm/options/toml_limits.hpp"

namespace rtpm::options {
namespace {

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
    if (text.size() > kTomlSizeMax) return fail("it is larger than 1 MiB");
  }
  if (std::ferror(file.get()) != 0) return fail(std::strerror(errno));
  return text;
}

/// Turns one file's nodes into entries.
class Reader {
 public:
  explicit Reader(std::string file) : file_(std::move(file)) {}

  [[nodiscard]] std::string place(const toml::source_position& at) const {
    return file_ + ":" + std::to_string(at.line) + ":" + std::to_string(at.column);
  }

  [[nodiscard]] SetupError error(const toml::node& node, const std::string& what) const {
    return {place(node.source().begin) + ": " + what};
  }

  expected<void, SetupError> add_table(const toml::table& table,
                                       const std::vector<std::string>& path) {
    std::vector<std::pair<const toml::key*, const toml::node*>> nodes;
    for (const auto& [key, node] : table)
      nodes.emplace_back(&key, &node);
    std::ranges::sort(nodes, {}, [](const auto& entry) {
      const toml::source_position at = entry.first->source().begin;
      return std::pair(at.line, at.column);
    });
    for (const auto& [key, node] : nodes) {
      std::vector<std::string> own = path;
      own.emplace_back(key->str());
      if (auto added = add(*node, own, key->source().begin); !added) return added;
    }
    return {};
  }

  std::vector<ConfigEntry> entries{};

 private:
  expected<void, SetupError> add(const toml::node& node, const std::vector<std::string>& path,
                                 const toml::source_position& at) {
    if (const toml::table* const table = node.as_table()) {
      entries.push_back({path, {}, true, place(at)});
      return add_table(*table, path);
    }
    ConfigEntry entry{path, {}, false, place(node.source().begin)};
    const toml::array* const list = node.as_array();
    if (list == nullptr) {
      entry.texts.push_back(text_of(node));
    } else {
      for (const toml::node& item : *list) {
        if (item.is_array() || item.is_table())
          return unexpected{error(item, key_text(path) + " is a list of tables or lists")};
        entry.texts.push_back(text_of(item));
      }
    }
    entries.push_back(std::move(entry));
    return {};
  }

  static std::string text_of(const toml::node& node) {
    if (const auto* const text = node.as_string()) return text->get();
    std::ostringstream written;
    if (const auto* const flag = node.as_boolean()) {
      written << (flag->get() ? "true" : "false");
    } else if (const auto* const whole = node.as_integer()) {
      written << whole->get();
    } else if (const auto* const number = node.as_floating_point()) {
      written.precision(17);
      written << number->get();
    } else {
      written << "a date or time";
    }
    return written.str();
  }

  std::string file_;
};

/// The table `config` of the program of that name; empty if it has none.
expected<toml::table, SetupError> config_of_program(toml::table& file, const std::string& name,
                                                    const std::string& path) {
  if (toml::array* const programs = file["program"].as_array()) {
    for (toml::node& program : *programs) {
      toml::table* const table = program.as_table();
      if (table == nullptr || (*table)["name"].value_or(std::string{}) != name) continue;
      toml::table* const config = (*table)["config"].as_table();
      return config == nullptr ? toml::table{} : std::move(*config);
    }
  }
  return unexpected{SetupError{path + ": no [[program]] has the name '" + name + "'"}};
}

}  // namespace

bool may_nest_too_deeply(std::string_view toml) {
  return std::ranges::count(toml, '.') > kTomlDotCountMax;
}

expected<std::vector<ConfigEntry>, SetupError> read_config_file(const std::string& name) {
  const std::size_t mark = std::min(name.find('#'), name.size());
  const std::string path = name.substr(0, mark);
  const auto text = read_text(path);
  if (!text) return unexpected{text.error()};
  if (may_nest_too_deeply(*text))
    return unexpected{SetupError{path + ": its tables nest too deeply"}};
  Reader reader(path);
  toml::parse_result parsed = toml::parse(*text);
  if (!parsed) {
    return unexpected{SetupError{reader.place(parsed.error().source().begin) + ": " +
                                 std::string(parsed.error().description())}};
  }
  toml::table table = std::move(parsed).table();
  if (mark < name.size()) {
    auto config = config_of_program(table, name.substr(mark + 1), path);
    if (!config) return unexpected{config.error()};
    table = std::move(*config);
  }
  if (auto added = reader.add_table(table, {}); !added) return unexpected{added.error()};
  return std::move(reader.entries);
}

std::string key_text(const std::vector<std::string>& path) {
  constexpr const char* kBare = "abcdefghijklmnopqrstuvwxyz0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ_-";
  std::string text;
  for (const std::string& key : path) {
    if (!text.empty()) text += '.';
    const bool is_bare = !key.empty() && key.find_first_not_of(kBare) == std::string::npos;
    text += is_bare ? key : quoted(key);
  }
  return text;
}

std::string quoted(std::string_view text) {
  std::string written = "\"";
  for (const char letter : text) {
    const auto byte = static_cast<unsigned char>(letter);
    if (byte < 0x20 || byte == 0x7f) {
      constexpr const char* kDigits = "0123456789abcdef";
      written.append("\\u00").append({kDigits[byte >> 4], kDigits[byte & 15]});
    } else {
      if (letter == '"' || letter == '\\') written += '\\';
      written += letter;
    }
  }
  return written + '"';
}

}  // namespace rtpm::options
