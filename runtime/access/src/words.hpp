#pragma once

#include <cstddef>
#include <functional>
#include <string_view>
#include <vector>

namespace rtpm::access {

/// A part of a line, and the byte at which it begins, from 1.
struct Word {
  std::string_view text{};
  std::size_t column = 0;
};

/// The words of a line, which spaces and tabs separate.
[[nodiscard]] std::vector<Word> words_of(std::string_view line);
/// The items that commas separate; "a,,b" has an empty one.
[[nodiscard]] std::vector<Word> items_of(const Word& list);
/// Calls `visit(line, number)` for each line except empty ones and comments, numbers from 1.
void visit_lines(std::string_view text,
                 const std::function<void(std::string_view line, std::size_t number)>& visit);

}  // namespace rtpm::access
