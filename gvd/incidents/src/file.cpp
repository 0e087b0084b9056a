#include "rtpm/incidents/file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "rtpm/base/nesting.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/durable_file.hpp"

namespace rtpm::incidents {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kByteCountMax = std::uint64_t{256} << 20;
constexpr std::uint64_t kLongSize = std::uint64_t{16} << 20;
constexpr std::size_t kSupersededMax = 1000;
constexpr std::size_t kLineSizeMax = 16 * 1024;
constexpr mode_t kFileMode = 0600;

/// A descriptor, closed at the end of its scope.
class Descriptor {
 public:
  explicit Descriptor(int number) noexcept : number_(number) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  [[nodiscard]] int number() const noexcept { return number_; }
  [[nodiscard]] bool is_open() const noexcept { return number_ >= 0; }

 private:
  int number_;
};

SetupError file_error(const std::string& path, const char* what, int code,
                      std::string remedy = {}) {
  return {"the incidents in " + printable(path) + " can't be " + what,
          std::generic_category().message(code), std::move(remedy)};
}

std::string line_of(const Incident& incident) {
  return to_json(incident) + "\n";
}

std::string line_of(std::uint64_t id, std::string_view person, std::uint64_t utc_ns) {
  const Json json{
      {"acknowledge", id}, {"by", printable(person, kPersonSizeMax)}, {"at_ns", utc_ns}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::uint64_t number_in(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : 0;
}

std::string text_in(const Json& json, const char* key, std::size_t size_max) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_string()) return {};
  return printable(found->get_ref<const std::string&>(), size_max);
}

Incident incident_of(const Json& json) {
  Incident incident{.id = number_in(json, "id"),
                    .who = text_in(json, "who", kTextSizeMax),
                    .what = text_in(json, "what", kTextSizeMax),
                    .why = text_in(json, "why", kTextSizeMax),
                    .since_ns = number_in(json, "since_ns"),
                    .until_ns = number_in(json, "until_ns"),
                    .count = std::max<std::uint64_t>(number_in(json, "count"), 1),
                    .recording = text_in(json, "recording", kTextSizeMax),
                    .acknowledged_by = text_in(json, "acknowledged_by", kPersonSizeMax),
                    .acknowledged_ns = number_in(json, "acknowledged_ns")};
  const std::string severity = text_in(json, "severity", kTextSizeMax);
  for (std::uint8_t i = 0; i < kSeverityCount; ++i) {
    if (severity == to_string(static_cast<Severity>(i))) {
      incident.severity = static_cast<Severity>(i);
    }
  }
  return incident;
}

/// The receiver of the lines of a file.
class LineTaker {
 public:
  LineTaker() = default;
  LineTaker(const LineTaker&) = delete;
  LineTaker& operator=(const LineTaker&) = delete;
  virtual void take_incident(Incident incident) = 0;
  virtual void take_acknowledgement(IncidentFile::Acknowledgement acknowledgement) = 0;
  virtual void take_torn() = 0;

 protected:
  ~LineTaker() = default;
};

void take_line(std::string_view line, LineTaker& taker) {
  if (line.empty()) return;
  if (line.size() > kLineSizeMax) return taker.take_torn();
  const auto json = parse_bounded_json<Json>(line);
  if (!json.is_object()) return taker.take_torn();
  if (const std::uint64_t id = number_in(json, "acknowledge"); id != 0) {
    return taker.take_acknowledgement(
        {id, text_in(json, "by", kPersonSizeMax), number_in(json, "at_ns")});
  }
  Incident incident = incident_of(json);
  if (incident.id == 0 || incident.who.empty() || incident.what.empty()) return taker.take_torn();
  taker.take_incident(std::move(incident));
}

/// Hands over the whole lines from `offset` on.
/// @return the offset behind the last whole line
expected<std::uint64_t, int> read_lines(const std::string& path, std::uint64_t offset,
                                        LineTaker& taker) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.is_open()) return errno == ENOENT ? expected<std::uint64_t, int>(0) : unexpected{errno};
  struct stat status {};
  if (::fstat(file.number(), &status) != 0) return unexpected{errno};
  if (!S_ISREG(status.st_mode)) return unexpected{EINVAL};
  const auto size = static_cast<std::uint64_t>(status.st_size);
  if (size > kByteCountMax) return unexpected{EFBIG};
  std::string waiting;
  std::string block(std::size_t{64} * 1024, '\0');
  // A shorter file than before was emptied by a person.
  std::uint64_t position = std::min(offset, size);
  while (true) {
    const ssize_t got =
        ::pread(file.number(), block.data(), block.size(), static_cast<off_t>(position));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return unexpected{errno};
    if (got == 0 || position > kByteCountMax) break;
    position += static_cast<std::uint64_t>(got);
    waiting.append(block, 0, static_cast<std::size_t>(got));
    std::size_t begin = 0;
    for (std::size_t end = waiting.find('\n'); end != std::string::npos;
         end = waiting.find('\n', begin)) {
      take_line(std::string_view(waiting).substr(begin, end - begin), taker);
      begin = end + 1;
    }
    waiting.erase(0, begin);
  }
  return position - waiting.size();
}

/// Appends whole lines by one write, behind a line feed if the last line was torn.
expected<void, int> append_text(const std::string& path, std::string text) {
  while (true) {
    const Descriptor file(::open(path.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, kFileMode));
    if (!file.is_open()) return unexpected{errno};
    struct stat status {};
    if (::fstat(file.number(), &status) != 0) return unexpected{errno};
    char last = '\n';
    if (status.st_size > 0 && ::pread(file.number(), &last, 1, status.st_size - 1) != 1) {
      return unexpected{errno};
    }
    if (last != '\n' && !text.starts_with('\n')) text.insert(0, "\n");
    const ssize_t written = ::write(file.number(), text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return unexpected{errno};
    if (static_cast<std::size_t>(written) < text.size()) return unexpected{ENOSPC};
    // The console may have replaced the file meanwhile: then the lines went to the old one.
    struct stat present {};
    if (::stat(path.c_str(), &present) == 0 && present.st_ino == status.st_ino) return {};
  }
}

class Collector final : public LineTaker {
 public:
  void take_incident(Incident incident) override {
    ++line_count;
    incidents[incident.id] = std::move(incident);
  }
  void take_acknowledgement(IncidentFile::Acknowledgement acknowledgement) override {
    ++line_count;
    const auto found = incidents.find(acknowledgement.id);
    if (found == incidents.end() || found->second.is_acknowledged()) return;
    found->second.acknowledged_by = std::move(acknowledgement.person);
    found->second.acknowledged_ns = acknowledgement.utc_ns;
  }
  void take_torn() override { ++torn_count; }

  std::map<std::uint64_t, Incident> incidents{};
  std::size_t line_count = 0;
  std::size_t torn_count = 0;
};

class Others final : public LineTaker {
 public:
  void take_incident(Incident) override {}
  void take_acknowledgement(IncidentFile::Acknowledgement acknowledgement) override {
    list.push_back(std::move(acknowledgement));
  }
  void take_torn() override {}
  std::vector<IncidentFile::Acknowledgement> list{};
};

}  // namespace

std::string to_json(const Incident& incident) {
  Json json{{"id", incident.id},
            {"who", incident.who},
            {"what", incident.what},
            {"why", incident.why},
            {"severity", to_string(incident.severity)},
            {"since_ns", incident.since_ns},
            {"until_ns", incident.until_ns},
            {"count", incident.count}};
  if (!incident.recording.empty()) json["recording"] = incident.recording;
  if (incident.is_acknowledged()) {
    json["acknowledged_by"] = incident.acknowledged_by;
    json["acknowledged_ns"] = incident.acknowledged_ns;
  }
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string default_file() {
  const auto path_in = [](const char* variable) {
    const char* const path = std::getenv(variable);
    return path != nullptr && *path == '/' ? std::string(path) : std::string();
  };
  const std::string state = path_in("XDG_STATE_HOME");
  if (!state.empty()) return state + "/rtpm/incidents.jsonl";
  const std::string home = path_in("HOME");
  return home.empty() ? "" : home + "/.local/state/rtpm/incidents.jsonl";
}

expected<Content, SetupError> read_file(const std::string& path) {
  Collector collector;
  const auto end = read_lines(path, 0, collector);
  if (!end) return unexpected{file_error(path, "read", end.error())};
  Content content{
      .line_count = collector.line_count, .torn_count = collector.torn_count, .byte_count = *end};
  for (auto& [id, incident] : collector.incidents)
    content.incidents.push_back(std::move(incident));
  return content;
}

expected<void, SetupError> acknowledge_in_file(const std::string& path,
                                               std::span<const std::uint64_t> ids,
                                               std::string_view person, std::uint64_t utc_ns) {
  std::string text;
  for (const std::uint64_t id : ids)
    text += line_of(id, person, utc_ns);
  if (auto appended = append_text(path, std::move(text)); !appended) {
    return unexpected{file_error(path, "acknowledged", appended.error())};
  }
  return {};
}

expected<IncidentFile, SetupError> IncidentFile::open(const std::string& path, Content& content) {
  std::error_code code;
  std::filesystem::create_directories(std::filesystem::path(path).parent_path(), code);
  IncidentFile file;
  file.path_ = path;
  file.lock_ = ::open((path + ".lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, kFileMode);
  if (file.lock_ < 0) return unexpected{file_error(path, "kept", errno)};
  if (::flock(file.lock_, LOCK_EX | LOCK_NB) != 0) {
    return setup_error("the incidents in " + printable(path) + " can't be kept",
                       "another rtpm-console keeps its own there",
                       "give each console a file of its own, --incidents FILE");
  }
  auto read = read_file(path);
  if (!read) return unexpected{read.error()};
  content = std::move(*read);
  file.read_to_ = content.byte_count;
  if (content.line_count > 2 * content.incidents.size() + kSupersededMax) {
    if (auto rewritten = file.rewrite(content.incidents); !rewritten) {
      return unexpected{rewritten.error()};
    }
  }
  // Shows now, rather than with the first incident, that nothing can be written.
  const Descriptor probe(::open(path.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, kFileMode));
  if (!probe.is_open()) return unexpected{file_error(path, "kept", errno)};
  return file;
}

IncidentFile::IncidentFile(IncidentFile&& other) noexcept
    : path_(std::move(other.path_)),
      lock_(std::exchange(other.lock_, -1)),
      read_to_(other.read_to_),
      rewritten_size_(other.rewritten_size_) {}

IncidentFile& IncidentFile::operator=(IncidentFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(lock_, other.lock_);
  read_to_ = other.read_to_;
  rewritten_size_ = other.rewritten_size_;
  return *this;
}

IncidentFile::~IncidentFile() {
  if (lock_ >= 0) ::close(lock_);
}

expected<void, SetupError> IncidentFile::append(std::span<const Incident> incidents) {
  std::string text;
  for (const Incident& incident : incidents)
    text += line_of(incident);
  if (text.empty()) return {};
  if (auto appended = append_text(path_, std::move(text)); !appended) {
    return unexpected{file_error(path_, "kept", appended.error(), "free space on that disk")};
  }
  return {};
}

std::vector<IncidentFile::Acknowledgement> IncidentFile::read_others() {
  Others others;
  const auto end = read_lines(path_, read_to_, others);
  if (end) read_to_ = *end;
  return std::move(others.list);
}

bool IncidentFile::is_long() const noexcept {
  return read_to_ > kLongSize + rewritten_size_;
}

expected<void, SetupError> IncidentFile::rewrite(std::span<const Incident> incidents) {
  std::string text;
  for (const Incident& incident : incidents)
    text += line_of(incident);
  if (auto replaced = rt::replace_file(path_, text); !replaced) {
    return unexpected{file_error(path_, "kept", replaced.error().value())};
  }
  read_to_ = text.size();
  rewritten_size_ = text.size();
  return {};
}

}  // namespace rtpm::incidents
