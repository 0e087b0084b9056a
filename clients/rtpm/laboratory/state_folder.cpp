#include "laboratory/state_folder.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>

#include "rtpm/base/nesting.hpp"

namespace rtpm::laboratory {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kRecordEnd = ".laboratory";
constexpr std::size_t kRecordSizeMax = std::size_t{64} * 1024;
constexpr mode_t kForOthers = 077;
constexpr int kTurnMax = 20;
constexpr int kTurnMs = 10;

std::string text_in(int file) {
  std::string text;
  std::array<char, 4096> part{};
  for (off_t at = 0; text.size() < kRecordSizeMax;) {
    const ssize_t size = ::pread(file, part.data(), part.size(), at);
    if (size <= 0) break;
    text.append(part.data(), static_cast<std::size_t>(size));
    at += size;
  }
  return text;
}

std::int64_t integer_in(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number_integer() ? found->get<std::int64_t>() : 0;
}

/// A record that is still being written has no facts yet.
RunningLaboratory parsed(const std::string& name, const std::string& text) {
  RunningLaboratory laboratory{.name = name};
  const Json json = parse_bounded_json<Json>(text);
  if (!json.is_object()) return laboratory;
  if (const auto file = json.find("file"); file != json.end() && file->is_string())
    laboratory.file = file->get<std::string>();
  laboratory.supervisor = {static_cast<pid_t>(integer_in(json, "pid")),
                           static_cast<std::uint64_t>(integer_in(json, "start_ticks"))};
  laboratory.stop_patience = std::chrono::milliseconds{integer_in(json, "stop_patience_ms")};
  if (const auto programs = json.find("programs"); programs != json.end() && programs->is_array()) {
    for (const Json& program : *programs) {
      if (program.is_string()) laboratory.programs.push_back(program.get<std::string>());
    }
  }
  return laboratory;
}

/// Whether the open file is still the one at `path`.
bool is_at(int file, const std::string& path) {
  struct stat opened {};
  struct stat named {};
  return ::fstat(file, &opened) == 0 && ::stat(path.c_str(), &named) == 0 &&
         opened.st_ino == named.st_ino && opened.st_dev == named.st_dev;
}

}  // namespace

expected<StateFolder, SetupError> StateFolder::open() {
  const char* const runtime = std::getenv("XDG_RUNTIME_DIR");
  std::string path = runtime != nullptr && *runtime == '/'
                         ? std::string(runtime) + "/rtpm"
                         : "/tmp/rtpm-" + std::to_string(::geteuid());
  if (::mkdir(path.c_str(), 0700) != 0 && errno != EEXIST) {
    return setup_error("the folder " + path + " can't be made", system_error(errno),
                       "set XDG_RUNTIME_DIR to a folder of your own");
  }
  struct stat found {};
  if (::lstat(path.c_str(), &found) != 0 || !S_ISDIR(found.st_mode)) {
    return setup_error(path + " is no folder", "", "remove it");
  }
  if (found.st_uid != ::geteuid() || (found.st_mode & kForOthers) != 0) {
    return setup_error(
        "the folder " + path + " is not safe",
        found.st_uid != ::geteuid() ? "it belongs to another user" : "others may enter it",
        found.st_uid != ::geteuid() ? "set XDG_RUNTIME_DIR to a folder of your own"
                                    : "chmod 700 " + path);
  }
  return StateFolder(std::move(path));
}

std::string StateFolder::record_path(const std::string& name) const {
  return path_ + "/" + name + kRecordEnd;
}

std::string StateFolder::log_path(const std::string& name) const {
  return path_ + "/" + name + ".log";
}

std::optional<RunningLaboratory> StateFolder::find(const std::string& name) const {
  const std::string path = record_path(name);
  const Handle file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  if (!file.is_open()) return std::nullopt;
  if (::flock(file.number(), LOCK_EX | LOCK_NB) != 0) {
    return parsed(name, text_in(file.number()));
  }
  // The record is not locked, so its processes were killed. This lock keeps other processes from
  // taking it over meanwhile.
  if (is_at(file.number(), path)) ::unlink(path.c_str());
  return std::nullopt;
}

std::vector<RunningLaboratory> StateFolder::list() const {
  std::vector<RunningLaboratory> laboratories;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(path_, error)) {
    if (entry.path().extension() != kRecordEnd) continue;
    if (auto laboratory = find(entry.path().stem().string()))
      laboratories.push_back(std::move(*laboratory));
  }
  std::ranges::sort(laboratories, {}, &RunningLaboratory::name);
  return laboratories;
}

expected<Record, SetupError> Record::create(const StateFolder& folder, const std::string& name) {
  const std::string path = folder.record_path(name);
  for (int turn = 0;; ++turn) {
    Handle file(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
    if (!file.is_open()) {
      return setup_error("the record " + path + " can't be made", system_error(errno));
    }
    if (::flock(file.number(), LOCK_EX | LOCK_NB) != 0) {
      const RunningLaboratory running = parsed(name, text_in(file.number()));
      const bool is_alive = identity_of(running.supervisor.id) == running.supervisor;
      if (!is_alive && turn < kTurnMax) {  // Another process may be removing a stale record.
        static_cast<void>(::poll(nullptr, 0, kTurnMs));
        continue;
      }
      return setup_error(
          "the laboratory '" + name + "' is already up" +
              (running.file.empty() ? "" : " from " + running.file) +
              (running.supervisor.id > 0 ? ", process " + std::to_string(running.supervisor.id)
                                         : ""),
          "", "`rtpm down " + name + "` ends it");
    }
    // Another process may have removed the file between both calls.
    if (is_at(file.number(), path)) return Record(path, std::move(file));
  }
}

void Record::write(const RunningLaboratory& laboratory) const {
  const std::string text =
      Json{{"file", laboratory.file},
           {"pid", laboratory.supervisor.id},
           {"start_ticks", laboratory.supervisor.start_ticks},
           {"stop_patience_ms",
            std::chrono::ceil<std::chrono::milliseconds>(laboratory.stop_patience).count()},
           {"programs", laboratory.programs}}
          .dump(-1, ' ', false, Json::error_handler_t::replace) +
      "\n";
  // An incomplete record is read as one without facts; only the lock matters.
  static_cast<void>(::ftruncate(file_.number(), 0));
  static_cast<void>(!::pwrite(file_.number(), text.data(), text.size(), 0));
}

void Record::remove() const {
  if (is_at(file_.number(), path_)) ::unlink(path_.c_str());
}

}  // namespace rtpm::laboratory
