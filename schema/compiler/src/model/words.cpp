#include "model/words.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <vector>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {
namespace {

/// Levenshtein's distance.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j)
    row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({change, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

}  // namespace

std::string most_similar(std::string_view word, std::span<const std::string_view> candidates) {
  // A misspelling has at most a third of its letters wrong.
  std::size_t best = word.size() / 3 + 1;
  std::string_view found;
  for (const std::string_view candidate : candidates) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance == 0 || distance >= best) continue;
    best = distance;
    found = candidate;
  }
  return std::string(found);
}

std::string with_article(std::string_view noun) {
  const bool is_vowel = !noun.empty() && std::string_view("aeio").find(noun[0]) != noun.npos;
  return (is_vowel ? "an " : "a ") + std::string(noun);
}

std::string number_text(double value) {
  std::array<char, 64> buffer{};
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return error == std::errc{} ? std::string(buffer.data(), end) : std::string("?");
}

std::string hexadecimal(std::uint64_t value, std::size_t digits) {
  constexpr std::size_t kLeadSize = 2;
  std::string text(kLeadSize + digits, '0');
  text[1] = 'x';
  for (std::size_t at = text.size(); at > kLeadSize; value >>= 4) {
    text[--at] = "0123456789abcdef"[value & 0xF];
  }
  return text;
}

std::string wrap_struct_hint(const std::string& type) {
  return "wrap it: `table " + short_name(type) + "Message { value:" + type +
         " (required); }`; on the wire that is the bare struct, so it costs nothing";
}

}  // namespace rtpm::schema
