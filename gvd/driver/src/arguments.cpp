#include "rtpm/driver/arguments.hpp"

#include <algorithm>

namespace rtpm::driver {
namespace {

unexpected<SetupError> refusal(std::string_view driver, const std::string& what,
                               const KnownWords& known) {
  std::string remedy = "give words like 'name=value'; the names are";
  const char* separator = " ";
  for (const auto* names : {&known.names, &known.names_to_the_end}) {
    for (const std::string_view name : *names) {
      remedy += separator;
      remedy += name;
      separator = ", ";
    }
  }
  return setup_error("the driver " + std::string(driver) + " " + what, "", remedy);
}

}  // namespace

expected<Words, SetupError> read_words(std::string_view driver, std::string_view text,
                                       const KnownWords& known) {
  Words words;
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
    if (text.empty()) return words;
    std::string_view word = text.substr(0, text.find(' '));
    const std::size_t name_size = std::min(word.find('='), word.size());
    const std::string_view name = word.substr(0, name_size);
    const bool goes_to_the_end = std::ranges::count(known.names_to_the_end, name) > 0;
    if (goes_to_the_end) word = text;
    if (!goes_to_the_end && std::ranges::count(known.names, name) == 0) {
      return refusal(driver, "does not know the word '" + std::string(name) + "'", known);
    }
    if (word.size() < name_size + 2) {
      return refusal(driver, "needs a value for '" + std::string(name) + "'", known);
    }
    if (!words.emplace(name, word.substr(name_size + 1)).second) {
      return refusal(driver, "was given '" + std::string(name) + "' twice", known);
    }
    text.remove_prefix(word.size());
  }
}

std::string value_of(const Words& words, std::string_view name) {
  const auto found = words.find(name);
  return found == words.end() ? std::string() : found->second;
}

}  // namespace rtpm::driver
