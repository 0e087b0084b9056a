#include "recording/folder.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <functional>
#include <optional>
#include <system_error>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/notes.hpp"

namespace rtpm::console {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kNameCountMax = 100'000;
constexpr std::size_t kNameSizeMax = 128;

/// Only of files whose summary tells all, so that none is read as a whole.
std::map<std::string, std::string> session_of(const fs::path& path) {
  const auto reader = recording::FileReader::open(path.string(), recording::Incomplete::kRefuse,
                                                  [](auto, auto) { return false; });
  if (!reader) return {};
  const auto metadata = (*reader)->read_metadata();
  if (!metadata) return {};
  for (const recording::Metadata& one : *metadata) {
    if (one.name == kSessionMetadata) return one.values;
  }
  return {};
}

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
  if (file.is_complete) file.session = session_of(path);
  return file;
}

/// Moves a file to a path at which there is none; never replaces one.
expected<void, SetupError> move_file(const fs::path& from, const fs::path& to) {
  const auto failed = [&](const std::error_code& error) {
    return setup_error("'" + from.filename().string() + "' can't be moved", error);
  };
  std::error_code error;
  fs::create_hard_link(from, to, error);
  const bool has_links = error != std::errc::operation_not_permitted &&
                         error != std::errc::function_not_supported &&
                         error != std::errc::operation_not_supported;
  if (!has_links) {
    // Such as FAT; another program could create the file in between.
    if (fs::exists(to, error)) return failed(std::make_error_code(std::errc::file_exists));
    fs::rename(from, to, error);
    if (error) return failed(error);
    return {};
  }
  if (error == std::errc::file_exists) {
    return setup_error("there is a recording '" + to.filename().string() + "' already", "",
                       "choose another name, or rename that one");
  }
  if (error) return failed(error);
  fs::remove(from, error);
  if (error) return failed(error);
  return {};
}

/// Moves a recording and its notes; if that fails, both stay.
expected<void, SetupError> move_recording(const fs::path& from, const fs::path& to) {
  const fs::path notes = recording::notes_path(from.string());
  const fs::path new_notes = recording::notes_path(to.string());
  if (auto moved = move_file(from, to); !moved) return moved;
  std::error_code error;
  if (!fs::exists(notes, error)) return {};
  auto moved = move_file(notes, new_notes);
  if (!moved) static_cast<void>(move_file(to, from));
  return moved;
}

expected<void, SetupError> require_file(const fs::path& path) {
  std::error_code error;
  if (fs::is_regular_file(path, error)) return {};
  return setup_error("there is no recording '" + path.filename().string() + "'", "",
                     "read the list anew");
}

/// Returns whether the file is gone.
bool remove_for_good(const fs::path& path) {
  std::error_code error;
  fs::remove(recording::notes_path(path.string()), error);
  return fs::remove(path, error) && !error;
}

/// Reads "1732665600000000000-run.mcap".
std::optional<DeletedRecording> read_id(const std::string& id) {
  DeletedRecording found{.id = id};
  const auto dash = id.find('-');
  if (dash == std::string::npos) return std::nullopt;
  const auto [end, error] = std::from_chars(id.data(), id.data() + dash, found.deleted_ns);
  if (error != std::errc{} || end != id.data() + dash) return std::nullopt;
  found.file = id.substr(dash + 1);
  return found;
}

}  // namespace

RecordingList RecordingFolder::list() {
  struct Found {
    std::string name{};
    std::uint64_t byte_count = 0;
    fs::file_time_type time{};
  };
  std::vector<Found> found;
  std::error_code error;
  for (fs::directory_iterator next(folder_, error), end; !error && next != end;
       next.increment(error)) {
    std::string name = next->path().filename().string();
    std::error_code ignored;
    if (!path_of(name) || !next->is_regular_file(ignored)) continue;
    const std::uint64_t size = next->file_size(ignored);
    if (ignored) continue;
    const auto time = next->last_write_time(ignored);
    if (!ignored) found.push_back({std::move(name), size, time});
    if (found.size() >= kNameCountMax) break;
  }
  RecordingList list;
  if (found.size() > kFileCountMax) {
    list.omitted_count = found.size() - kFileCountMax;
    std::ranges::sort(found, std::ranges::greater{}, &Found::time);
    found.resize(kFileCountMax);
  }
  std::ranges::sort(found, {}, &Found::name);
  const std::lock_guard lock(mutex_);
  std::erase_if(known_, [&](const auto& one) {
    const auto same = std::ranges::lower_bound(found, one.first, {}, &Found::name);
    return same == found.end() || same->name != one.first;
  });
  for (const Found& one : found) {
    auto known = known_.find(one.name);
    const bool is_same = known != known_.end() && known->second.byte_count == one.byte_count &&
                         known->second.time == one.time;
    if (!is_same) {
      auto file = look_at(folder_ / one.name);
      if (!file) continue;
      file->file = one.name;
      file->byte_count = one.byte_count;
      known = known_.insert_or_assign(one.name, Known{one.byte_count, one.time, std::move(*file)})
                  .first;
    }
    list.files.push_back(known->second.file);
  }
  return list;
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
  if (folder_.empty()) {
    return setup_error("rtpm-console has no folder for recordings", "",
                       "start it with --recordings FOLDER");
  }
  return folder_ / file;
}

expected<void, SetupError> RecordingFolder::rename(std::string_view file, std::string_view name) {
  const auto from = path_of(file);
  if (!from) return unexpected{from.error()};
  const auto to = path_of(name);
  if (!to) return unexpected{to.error()};
  if (auto there = require_file(*from); !there) return there;
  const std::lock_guard lock(mutex_);
  return move_recording(*from, *to);
}

expected<std::string, SetupError> RecordingFolder::remove(std::string_view file,
                                                          std::uint64_t now_ns) {
  const auto from = path_of(file);
  if (!from) return unexpected{from.error()};
  if (auto there = require_file(*from); !there) return unexpected{there.error()};
  const std::lock_guard lock(mutex_);
  std::error_code error;
  fs::create_directory(deleted_folder(), error);
  if (error) return setup_error("'" + std::string(file) + "' can't be deleted", error);
  std::string id = std::to_string(now_ns) + "-" + std::string(file);
  if (auto moved = move_recording(*from, deleted_folder() / id); !moved) {
    return unexpected{moved.error()};
  }
  return id;
}

expected<std::string, SetupError> RecordingFolder::restore(std::string_view id) {
  const auto found = read_id(std::string(id));
  const auto to = path_of(found ? found->file : std::string{});
  if (!to || !require_file(deleted_folder() / id)) {
    return setup_error("there is no deleted recording '" + printable(id) + "'",
                       "it was restored, or is gone for good", "read the list anew");
  }
  const std::lock_guard lock(mutex_);
  if (auto moved = move_recording(deleted_folder() / id, *to); !moved) {
    return unexpected{moved.error()};
  }
  return found->file;
}

std::vector<DeletedRecording> RecordingFolder::deleted() const {
  std::vector<DeletedRecording> all;
  std::error_code error;
  for (fs::directory_iterator next(deleted_folder(), error), end; !error && next != end;
       next.increment(error)) {
    auto found = read_id(next->path().filename().string());
    std::error_code ignored;
    if (!found || !path_of(found->file) || !next->is_regular_file(ignored)) continue;
    found->byte_count = next->file_size(ignored);
    if (!ignored) all.push_back(std::move(*found));
    if (all.size() >= kNameCountMax) break;
  }
  std::ranges::sort(all, std::ranges::greater{}, &DeletedRecording::deleted_ns);
  return all;
}

std::vector<std::string> RecordingFolder::purge(std::uint64_t now_ns) {
  std::vector<std::string> gone;
  std::uint64_t byte_count = 0;
  std::size_t count = 0;
  for (const DeletedRecording& each : deleted()) {
    byte_count += each.byte_count;
    const bool is_old = now_ns > each.deleted_ns && now_ns - each.deleted_ns > kKeptNs;
    const bool is_excess = count > 0 && (count >= kDeletedCountMax || byte_count > kDeletedByteMax);
    ++count;
    if ((is_old || is_excess) && remove_for_good(deleted_folder() / each.id)) {
      gone.push_back(each.file);
    }
  }
  return gone;
}

std::size_t RecordingFolder::purge_all() {
  return static_cast<std::size_t>(std::ranges::count_if(
      deleted(), [this](const auto& each) { return remove_for_good(deleted_folder() / each.id); }));
}

}  // namespace rtpm::console
