#include "words.hpp"

namespace rtpm::access {

std::vector<Word> words_of(std::string_view line) {
  constexpr std::string_view kSpaces = " \t\r";
  std::vector<Word> words;
  std::size_t at = line.find_first_not_of(kSpaces);
  while (at != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(kSpaces, at), line.size());
    words.push_back({line.substr(at, end - at), at + 1});
    at = line.find_first_not_of(kSpaces, end);
  }
  return words;
}

std::vector<Word> items_of(const Word& list) {
  std::vector<Word> items;
  std::size_t at = 0;
  while (true) {
    const std::size_t comma = std::min(list.text.find(',', at), list.text.size());
    items.push_back({list.text.substr(at, comma - at), list.column + at});
    if (comma == list.text.size()) return items;
    at = comma + 1;
  }
}

void visit_lines(std::string_view text,
                 const std::function<void(std::string_view line, std::size_t number)>& visit) {
  std::size_t number = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    ++number;
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first != std::string_view::npos && line[first] != '#') visit(line, number);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
}

}  // namespace rtpm::access
