#include "rtpm/program/text.hpp"

#include <algorithm>
#include <cstdarg>
#include <cstdio>

namespace rtpm::program {
namespace {

/// The number of letters to insert, delete, replace or swap with their neighbour to turn `from`
/// into `to` (the distance of Damerau and Levenshtein, restricted form).
std::size_t slip_count(std::string_view from, std::string_view to) {
  std::vector<std::vector<std::size_t>> cost(from.size() + 1,
                                             std::vector<std::size_t>(to.size() + 1));
  for (std::size_t i = 0; i <= from.size(); ++i) {
    for (std::size_t k = 0; k <= to.size(); ++k) {
      if (i == 0 || k == 0) {
        cost[i][k] = i + k;
        continue;
      }
      cost[i][k] = std::min({cost[i - 1][k] + 1, cost[i][k - 1] + 1,
                             cost[i - 1][k - 1] + (from[i - 1] == to[k - 1] ? 0U : 1U)});
      if (i > 1 && k > 1 && from[i - 1] == to[k - 2] && from[i - 2] == to[k - 1])
        cost[i][k] = std::min(cost[i][k], cost[i - 2][k - 2] + 1);
    }
  }
  return cost[from.size()][to.size()];
}

}  // namespace

std::string formatted(const char* format, ...) {
  std::va_list arguments;
  va_start(arguments, format);
  std::va_list again;
  va_copy(again, arguments);
  const int size = std::vsnprintf(nullptr, 0, format, arguments);
  va_end(arguments);
  // One more for the terminating zero.
  std::string text(static_cast<std::size_t>(std::max(size, 0)) + 1, '\0');
  std::vsnprintf(text.data(), text.size(), format, again);
  va_end(again);
  text.pop_back();
  return text;
}

std::string joined(const std::vector<std::string>& texts, std::string_view separator) {
  std::string all;
  for (const std::string& text : texts)
    all.append(&text == &texts.front() ? "" : separator).append(text);
  return all;
}

std::string suggestion(std::string_view word, const std::vector<std::string>& candidates) {
  // The distance costs the product of the lengths, and no key is that long.
  if (word.size() > 64) return {};
  // A typing error leaves most letters in place; a more distant candidate would be a guess.
  std::size_t best = std::max<std::size_t>(1, word.size() / 3) + 1;
  std::string nearest;
  for (const std::string& candidate : candidates) {
    const std::size_t slips = slip_count(word, candidate);
    if (slips < best) {
      best = slips;
      nearest = candidate;
    }
  }
  return nearest.empty() ? "" : " (did you mean '" + nearest + "'?)";
}

}  // namespace rtpm::program
