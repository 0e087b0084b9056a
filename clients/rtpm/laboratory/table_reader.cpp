#include "laboratory/table_reader.hpp"

#include <algorithm>

#include "rtpm/options/duration.hpp"
#include "rtpm/options/suggestion.hpp"

namespace rtpm::laboratory {

TableReader::TableReader(const Value& table, std::string where, std::vector<Mistake>& mistakes)
    : table_(table), where_(std::move(where)), mistakes_(mistakes) {}

const Value* TableReader::take(std::string_view key) {
  known_.emplace_back(key);
  return table_.find(key);
}

const Value* TableReader::take(std::string_view key, Value::Kind kind, const std::string& form) {
  const Value* const value = take(key);
  if (value == nullptr || value->kind == kind) return value;
  refuse(value->position,
         "'" + std::string(key) + "' is " + value->kind_text() + ", but must be " + form);
  return nullptr;
}

const Value* TableReader::read(std::string_view key, std::string& text) {
  const Value* const value = take(key, Value::Kind::kText, "a text");
  if (value != nullptr) text = value->text;
  return value;
}

const Value* TableReader::read(std::string_view key, bool& value) {
  const Value* const found = take(key, Value::Kind::kBool, "true or false");
  if (found != nullptr) value = found->boolean;
  return found;
}

const Value* TableReader::read(std::string_view key, std::size_t& value,
                               options::Range<std::size_t> range) {
  const std::string form =
      "a whole number from " + std::to_string(range.low) + " to " + std::to_string(range.high);
  const Value* const found = take(key, Value::Kind::kInteger, form);
  if (found == nullptr) return nullptr;
  if (found->integer < 0 || static_cast<std::uint64_t>(found->integer) < range.low ||
      static_cast<std::uint64_t>(found->integer) > range.high) {
    refuse(found->position, "'" + std::string(key) + "' is " + std::to_string(found->integer) +
                                ", but must be " + form);
    return nullptr;
  }
  value = static_cast<std::size_t>(found->integer);
  return found;
}

const Value* TableReader::read(std::string_view key, Duration& value,
                               options::Range<Duration> range) {
  const std::string form = "a time from \"" + options::duration_text(range.low) + "\" to \"" +
                           options::duration_text(range.high) + "\"";
  const Value* const found = take(key, Value::Kind::kText, form);
  if (found == nullptr) return nullptr;
  const auto time = options::parse_duration(found->text);
  if (!time || *time < range.low || *time > range.high) {
    refuse(found->position,
           "'" + std::string(key) + "' is \"" + found->text + "\", but must be " + form);
    return nullptr;
  }
  value = *time;
  return found;
}

const Value* TableReader::read(std::string_view key, std::vector<std::string>& texts) {
  const std::string form = "a list of texts";
  const Value* const found = take(key, Value::Kind::kList, form);
  if (found == nullptr) return nullptr;
  std::vector<std::string> read;
  for (const Value& item : found->items) {
    if (item.kind != Value::Kind::kText) {
      refuse(item.position,
             "'" + std::string(key) + "' has " + item.kind_text() + ", but must be " + form);
      return nullptr;
    }
    read.push_back(item.text);
  }
  texts = std::move(read);
  return found;
}

void TableReader::refuse_choice(std::string_view key, const Value& value,
                                const std::vector<std::string>& words) {
  std::string list;
  for (std::size_t i = 0; i < words.size(); ++i)
    list += (i == 0 ? "\"" : i + 1 == words.size() ? " or \"" : ", \"") + words[i] + "\"";
  refuse(value.position, "'" + std::string(key) + "' is \"" + value.text + "\"" +
                             options::suggestion(value.text, words) + ", but must be " + list);
}

void TableReader::refuse_unknown() {
  for (const Value& entry : table_.items) {
    if (std::ranges::find(known_, entry.key) != known_.end()) continue;
    std::string list;
    for (const std::string& key : known_)
      list += (list.empty() ? "" : ", ") + key;
    refuse(entry.key_position,
           "unknown key '" + entry.key + "'" + options::suggestion(entry.key, known_),
           "there are: " + list);
  }
}

void TableReader::refuse(Position position, std::string what, std::string remedy) {
  mistakes_.push_back(
      {position, (where_.empty() ? "" : where_ + ": ") + std::move(what), std::move(remedy)});
}

}  // namespace rtpm::laboratory
