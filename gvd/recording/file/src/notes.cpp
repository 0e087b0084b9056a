#include "rtpm/recording/notes.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "rtpm/base/nesting.hpp"
#include "rtpm/rt/durable_file.hpp"

namespace rtpm::recording {
namespace {

using Json = nlohmann::ordered_json;

/// Notes of the greatest number and size, each byte escaped.
constexpr std::uintmax_t kFileByteMax = kNoteCountMax * (6 * kNoteSizeMax + 100);

unexpected<SetupError> unreadable(const std::string& path, std::string why) {
  return setup_error("the notes '" + path + "' can't be read", std::move(why),
                     "repair or remove that file; the recording itself is not affected");
}

}  // namespace

std::string notes_path(const std::string& recording) {
  return recording + ".notes.json";
}

expected<std::vector<Note>, SetupError> read_notes(const std::string& recording) {
  namespace fs = std::filesystem;
  const std::string path = notes_path(recording);
  std::error_code error;
  if (!fs::exists(path, error) && !error) return std::vector<Note>{};
  if (error) return unreadable(path, error.message());
  if (!fs::is_regular_file(path, error)) return unreadable(path, "it is no regular file");
  if (fs::file_size(path, error) > kFileByteMax) return unreadable(path, "it is too large");
  std::ifstream file(path, std::ios::binary);
  const std::string content{std::istreambuf_iterator<char>(file), {}};
  if (!file.is_open() || file.bad()) return unreadable(path, "it can't be opened");
  const auto json = parse_bounded_json<Json>(content);
  const auto list = json.is_object() ? json.find("notes") : json.end();
  if (!json.is_object() || list == json.end() || !list->is_array() ||
      list->size() > kNoteCountMax) {
    return unreadable(path, "it has no list of notes");
  }
  std::vector<Note> notes;
  for (const Json& each : *list) {
    const auto has = [&each](const char* key, auto is_right) {
      const auto found = each.find(key);
      return found != each.end() && is_right(*found);
    };
    const auto is_time = [](const Json& value) { return value.is_number_unsigned(); };
    if (!each.is_object() || !has("time_ns", is_time) ||
        !has("text", [](const Json& value) { return value.is_string(); })) {
      return unreadable(path, "a note lacks its time or text");
    }
    notes.push_back({.time_ns = each["time_ns"].get<std::uint64_t>(),
                     .text = each["text"].get<std::string>(),
                     .made_ns = has("made_ns", is_time) ? each["made_ns"].get<std::uint64_t>()
                                                        : std::uint64_t{0}});
  }
  std::ranges::stable_sort(notes, {}, &Note::time_ns);
  return notes;
}

expected<void, SetupError> write_notes(const std::string& recording, std::vector<Note> notes) {
  const std::string path = notes_path(recording);
  const auto refused = [&path](std::string why, std::string remedy) {
    return setup_error("the notes '" + path + "' can't be written", std::move(why),
                       std::move(remedy));
  };
  if (notes.size() > kNoteCountMax) return refused("a recording has at most 10000", "");
  for (const Note& note : notes) {
    if (note.text.empty()) return refused("a note has no text", "write one");
    if (note.text.size() > kNoteSizeMax) return refused("a note is too long", "shorten it");
  }
  if (notes.empty()) {
    std::error_code error;
    std::filesystem::remove(path, error);
    if (error) return refused(error.message(), "");
    return {};
  }
  std::ranges::stable_sort(notes, {}, &Note::time_ns);
  Json list = Json::array();
  for (const Note& note : notes)
    list.push_back({{"time_ns", note.time_ns}, {"text", note.text}, {"made_ns", note.made_ns}});
  const Json json{{"notes", std::move(list)}};
  const auto replaced =
      rt::replace_file(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  if (!replaced) return refused(replaced.error().message(), "");
  return {};
}

}  // namespace rtpm::recording
