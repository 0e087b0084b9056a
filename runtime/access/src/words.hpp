#pragma once

#include <cstddef>
#include <functional>
#include <string_view>
#include <vector>

namespace rtpm::access {

/// A part of a line, and its first byte's position, from 1.
struct Word {
  std::string_view text{};
  std::size_t column = 0;
};

/// The words of a line, separated by spaces and tabs.
[[nodiscard]] std::vector<Word> words_of(std::string_view line);
/// The items of a list, separated by commas; "a,,b" contains an empty one.
[[nodiscard]] std::vector<Word> items_of(const Word& list);
/// Calls `visit(line, number)` for each line except empty ones and comments; numbers start at 1.
void visit_lines(std::string_view text,
                 const std::function<void(std::string_view line, std::size_t number)>& visit);

}  // namespace rtpm::access
