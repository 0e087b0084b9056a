#include "csv_text.hpp"

#include <cerrno>
#include <charconv>
#include <cstddef>
#include <ctime>
#include <fstream>
#include <system_error>

#include "rtpm/base/civil_time.hpp"

namespace rtpm::exports {
namespace {

constexpr std::size_t kFileNameSizeMax = 200;
constexpr std::uint64_t kNsPerS = 1'000'000'000;

}  // namespace

std::string file_stem(const std::string& topic) {
  std::string stem = topic.substr(0, kFileNameSizeMax);
  for (char& c : stem) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                          (c >= '0' && c <= '9') || c == '-' || c == '.';
    if (!is_plain) c = '_';
  }
  if (stem.empty() || stem.front() == '.') stem.insert(0, "_");
  return stem;
}

void append_text_cell(std::string& line, std::string_view text) {
  constexpr std::string_view kFormulaMarks = "=+-@";
  double ignored = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), ignored);
  const bool is_number = parsed.ec == std::errc{} && parsed.ptr == text.data() + text.size();
  const bool is_formula =
      !text.empty() && kFormulaMarks.find(text.front()) != std::string_view::npos && !is_number;
  if (!is_formula && text.find_first_of(",\"\r\n") == std::string_view::npos) {
    line += text;
    return;
  }
  line += is_formula ? "\"'" : "\"";
  for (const char c : text) {
    if (c == '"') line += '"';
    line += c;
  }
  line += '"';
}

std::string time_text(std::uint64_t ns) {
  const std::tm utc = civil_utc(ns);
  std::string text(32, '\0');
  text.resize(std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S.", &utc));
  const std::string fraction = std::to_string(ns % kNsPerS);
  return text + std::string(9 - fraction.size(), '0') + fraction + "Z";
}

std::string seconds_text(std::uint64_t ns, std::uint64_t begin_ns) {
  const bool is_before = ns < begin_ns;
  const std::uint64_t span = is_before ? begin_ns - ns : ns - begin_ns;
  const std::string fraction = std::to_string(span % kNsPerS);
  return (is_before ? "-" : "") + std::to_string(span / kNsPerS) + "." +
         std::string(9 - fraction.size(), '0') + fraction;
}

expected<void, SetupError> append_to_file(const std::filesystem::path& path,
                                          std::string_view text) {
  std::ofstream file(path, std::ios::app | std::ios::binary);
  file << text << std::flush;
  if (file) return {};
  return setup_error("'" + path.string() + "' can't be written", system_error(errno));
}

bool is_like(std::string_view text, std::string_view pattern) noexcept {
  std::size_t at = 0;
  std::size_t next = 0;
  std::size_t star = std::string_view::npos;  // The last `*`, which takes up to `taken`.
  std::size_t taken = 0;
  while (at < text.size()) {
    if (next < pattern.size() && pattern[next] == '*') {
      star = next++;
      taken = at;
    } else if (next < pattern.size() && (pattern[next] == '?' || pattern[next] == text[at])) {
      ++next;
      ++at;
    } else if (star != std::string_view::npos) {
      next = star + 1;
      at = ++taken;
    } else {
      return false;
    }
  }
  while (next < pattern.size() && pattern[next] == '*')
    ++next;
  return next == pattern.size();
}

}  // namespace rtpm::exports
