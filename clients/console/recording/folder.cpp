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
constexpr std::size_t kNameSizeMax = 128;

std::optional<RecordingFile> look_at(const fs::path& path) {
  const auto reader = recording::FileReader::open(path.string(), recording::Incomplete::kRead);
  if (!reader) return std::nullopt;
  const recording::Statistics& statistics = (*reader)->statistics();
  return RecordingFile{.begin_ns = statistics.begin_ns,
                       .end_ns = statistics.end_ns,
                       .message_count = statistics.message_count,
                       .is_complete = (*reader)->is_complete()};
}

}  // namespace

std::vector<RecordingFile> RecordingFolder::list() {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator next(folder_, error), end; !error && next != end;
       next.increment(error)) {
    std::string name = next->path().filename().string();
    if (path_of(name)) names.push_back(std::move(name));
  }
  std::ranges::sort(names);
  if (names.size() > kFileCountMax) names.resize(kFileCountMax);
  const std::lock_guard lock(mutex_);
  std::vector<RecordingFile> files;
  for (const std::string& name : names) {
    const std::uint64_t size = fs::file_size(folder_ / name, error);
    if (error) continue;
    auto known = known_.find(name);
    // What is not complete may have become so.
    if (known == known_.end() || known->second.byte_count != size ||
        !known->second.file.is_complete) {
      auto file = look_at(folder_ / name);
      if (!file) continue;
      file->file = name;
      file->byte_count = size;
      known = known_.insert_or_assign(name, Known{size, std::move(*file)}).first;
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
