#include "recording/folder.hpp"

#include <algorithm>
#include <cctype>
#include <optional>
#include <system_error>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::console {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFileCountMax = 200;
constexpr std::size_t kNameCountMax = 10'000;
constexpr std::size_t kNameSizeMax = 128;

/// Reads only the end of the file, so that no file takes long, whatever its real or claimed size.
std::optional<RecordingFile> look_at(const fs::path& path) {
  const auto outline = recording::read_outline(path.string());
  if (!outline) return std::nullopt;
  RecordingFile file{.is_complete = outline->is_complete};
  if (outline->statistics) {
    file.begin_ns = outline->statistics->begin_ns;
    file.end_ns = outline->statistics->end_ns;
    file.message_count = outline->statistics->message_count;
  }
  return file;
}

}  // namespace

std::vector<RecordingFile> RecordingFolder::list() {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator next(folder_, error), end; !error && next != end;
       next.increment(error)) {
    std::string name = next->path().filename().string();
    if (path_of(name)) names.push_back(std::move(name));
    if (names.size() >= kNameCountMax) break;
  }
  std::ranges::sort(names);
  if (names.size() > kFileCountMax) names.resize(kFileCountMax);
  const std::lock_guard lock(mutex_);
  std::erase_if(known_,
                [&](const auto& one) { return !std::ranges::binary_search(names, one.first); });
  std::vector<RecordingFile> files;
  for (const std::string& name : names) {
    if (!fs::is_regular_file(folder_ / name, error)) continue;
    const std::uint64_t size = fs::file_size(folder_ / name, error);
    if (error) continue;
    const auto time = fs::last_write_time(folder_ / name, error);
    if (error) continue;
    auto known = known_.find(name);
    const bool is_same =
        known != known_.end() && known->second.byte_count == size && known->second.time == time;
    if (!is_same) {
      auto file = look_at(folder_ / name);
      if (!file) continue;
      file->file = name;
      file->byte_count = size;
      known = known_.insert_or_assign(name, Known{size, time, std::move(*file)}).first;
    }
    files.push_back(known->second.file);
  }
  return files;
}

expected<fs::path, SetupError> RecordingFolder::path_of(std::string_view file) const {
  const bool is_plain = std::ranges::all_of(file, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-';
  });
  if (!is_plain || file.size() > kNameSizeMax || file.starts_with('.') ||
      !file.ends_with(".mcap")) {
    return setup_error("'" + printable(file) + "' is no name of a recording", "",
                       "name it such as run-1.mcap: letters, digits, '.', '_', '-'");
  }
  return folder_ / file;
}

}  // namespace rtpm::console
