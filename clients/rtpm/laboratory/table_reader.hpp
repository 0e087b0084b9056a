#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "laboratory/document.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/options/options.hpp"

namespace rtpm::laboratory {

/// Reads a table with known keys. Adds mistakes to a list; the variable then keeps its default.
/// @ownership refers to the table and the list
/// @threads  one
class TableReader {
 public:
  /// @param where  for messages: "program 'devices'"
  TableReader(const Value& table, std::string where, std::vector<Mistake>& mistakes);

  /// The value of a key, which then counts as known; nullptr if absent.
  [[nodiscard]] const Value* take(std::string_view key);
  /// Takes a value of one kind; nullptr if absent, or of another kind, which is a mistake.
  /// @param form  the required form, for the message: "a text"
  [[nodiscard]] const Value* take(std::string_view key, Value::Kind kind, const std::string& form);

  /// @return the value, if it is present and valid
  const Value* read(std::string_view key, std::string& text);
  const Value* read(std::string_view key, bool& value);
  const Value* read(std::string_view key, std::size_t& value, options::Range<std::size_t> range);
  const Value* read(std::string_view key, Duration& value, options::Range<Duration> range);
  /// Reads a list of texts.
  const Value* read(std::string_view key, std::vector<std::string>& texts);

  /// Reads one of `choices`, by its word.
  template <class T>
  const Value* read(std::string_view key, T& value,
                    const std::vector<std::pair<std::string, T>>& choices) {
    std::vector<std::string> words;
    words.reserve(choices.size());
    for (const auto& choice : choices)
      words.push_back(choice.first);
    std::string word;
    const Value* const found = read(key, word);
    if (found == nullptr) return nullptr;
    for (const auto& choice : choices) {
      if (choice.first == word) {
        value = choice.second;
        return found;
      }
    }
    refuse_choice(key, *found, words);
    return nullptr;
  }

  /// Reports unknown keys as mistakes.
  void refuse_unknown();
  void refuse(Position position, std::string what, std::string remedy = {});

 private:
  void refuse_choice(std::string_view key, const Value& value,
                     const std::vector<std::string>& words);

  const Value& table_;
  const std::string where_;
  std::vector<Mistake>& mistakes_;
  std::vector<std::string> known_{};
};

}  // namespace rtpm::laboratory
