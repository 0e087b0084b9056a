#include "downloads/download_desk.hpp"

#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <system_error>
#include <utility>
#include <vector>

#include "rtpm/base/printable.hpp"
#include "rtpm/exports/zip.hpp"
#include "rtpm/recording/notes.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

constexpr std::string_view kFolderBegin = ".download-";
constexpr std::size_t kPatternCountMax = 256;
constexpr std::size_t kTextSizeMax = 256;
constexpr double kRateMaxHz = 1e6;
/// How much of the progress is the tables' if a ZIP file follows.
constexpr double kTablePart = 0.8;

/// Reads a request's fields, and keeps the first problem.
class Fields {
 public:
  explicit Fields(const nlohmann::json& request) : request_(request) {}

  std::string text(const char* key) {
    const auto found = request_.find(key);
    if (found == request_.end() || found->is_null()) return {};
    if (found->is_string() && found->get_ref<const std::string&>().size() <= kTextSizeMax)
      return found->get<std::string>();
    refuse(key, "must be a text of at most 256 bytes");
    return {};
  }
  std::vector<std::string> texts(const char* key) {
    std::vector<std::string> result;
    const auto found = request_.find(key);
    if (found == request_.end() || found->is_null()) return result;
    bool is_right = found->is_array() && found->size() <= kPatternCountMax;
    if (is_right) {
      for (const auto& one : *found) {
        is_right =
            is_right && one.is_string() && one.get_ref<const std::string&>().size() <= kTextSizeMax;
        if (is_right) result.push_back(one.get<std::string>());
      }
    }
    if (!is_right) refuse(key, "must be a list of at most 256 texts");
    return result;
  }
  std::optional<double> number(const char* key, double low, double high) {
    const auto found = request_.find(key);
    if (found == request_.end() || found->is_null()) return std::nullopt;
    const double value = found->is_number() ? found->get<double>() : NAN;
    if (value >= low && value <= high) return value;
    refuse(key, "must be a number in its range");
    return std::nullopt;
  }
  bool flag(const char* key) {
    const auto found = request_.find(key);
    if (found == request_.end() || found->is_null()) return false;
    if (!found->is_boolean()) refuse(key, "must be true or false");
    return found->is_boolean() && found->get<bool>();
  }
  void refuse(const std::string& key, const std::string& why) {
    if (problem_.empty()) problem_ = "`" + key + "` " + why;
  }
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

 private:
  const nlohmann::json& request_;
  std::string problem_{};
};

exports::TableOptions options_in(Fields& fields) {
  exports::TableOptions options{.topics = fields.texts("topics"),
                                .columns = fields.texts("columns"),
                                .is_joined = fields.flag("joined")};
  options.rate_hz = fields.number("rate_hz", 0, kRateMaxHz).value_or(0);
  options.part.from_s = fields.number("from_s", 0, 1e9);
  options.part.to_s = fields.number("to_s", 0, 1e9);
  const auto between = fields.texts("between");
  if (between.size() == 2) options.part.between = {between[0], between[1]};
  if (between.size() == 1 || between.size() > 2) fields.refuse("between", "must be two labels");
  if (const auto trial = fields.number("trial", 0, UINT32_MAX))
    options.part.trial = static_cast<std::uint32_t>(*trial);
  if (const std::string condition = fields.text("condition"); !condition.empty())
    options.part.condition = condition;
  return options;
}

/// Removes the folders of consoles that have ended.
void remove_leftovers(const fs::path& root) {
  std::error_code error;
  std::vector<fs::path> dead;
  for (fs::directory_iterator next(root, error), end; !error && next != end;
       next.increment(error)) {
    const std::string name = next->path().filename().string();
    if (!name.starts_with(kFolderBegin)) continue;
    const long pid = std::strtol(name.c_str() + kFolderBegin.size(), nullptr, 10);
    const bool is_dead = pid > 0 && ::kill(static_cast<pid_t>(pid), 0) != 0 && errno == ESRCH;
    if (is_dead && fs::is_directory(next->symlink_status(error))) dead.push_back(next->path());
  }
  for (const fs::path& folder : dead)
    fs::remove_all(folder, error);
}

}  // namespace

DownloadDesk::DownloadDesk(fs::path folder, CallRouter& router, Post post)
    : root_(std::move(folder)), folder_(root_), router_(router), post_(std::move(post)) {}

expected<void, SetupError> DownloadDesk::start() {
  if (!root_.empty()) remove_leftovers(root_);
  router_.add_json("console/download", [this](const PendingCall& call, const Json& request) {
    download(call, request);
  });
  router_.add_json(
      "console/download_choices",
      [this](const PendingCall& call, const Json& request) { show_choices(call, request); });
  // Adds a service on a file that is being made.
  const auto add = [this](const char* name, auto serve) {
    router_.add_json(name, [this, serve](const PendingCall& call, const Json& request) {
      const auto found = making_.find({call.connection_id, Fields(request).text("id")});
      if (found == making_.end()) return router_.fail(call, "no download with this id is made");
      router_.succeed(call, serve(*found->second));
    });
  };
  add("console/download_progress", [](const Making& making) {
    return OrderedJson{{"part", making.part.load()}};
  });
  add("console/download_cancel", [](Making& making) {
    making.is_cancelled = true;
    return OrderedJson::object();
  });
  return workers_.start({.name = "console-export", .thread_count = 2, .queued_max = 64});
}

void DownloadDesk::stop() {
  is_ending_ = true;
  workers_.stop();
}

std::optional<Download> DownloadDesk::take(std::string_view ticket, MonotonicTime now) {
  return tickets_.take(ticket, now);
}

void DownloadDesk::on_close(std::uint64_t connection_id) {
  tickets_.drop(connection_id);
  for (const auto& [key, making] : making_) {
    if (key.first == connection_id) making->is_cancelled = true;
  }
}

void DownloadDesk::download(const PendingCall& call, const Json& request) {
  Fields fields(request);
  const Key key{call.connection_id, fields.text("id")};
  const std::string file = fields.text("file");
  const std::string format = fields.text("format");
  const exports::TableOptions options = options_in(fields);
  if (!fields.problem().empty()) return router_.fail(call, fields.problem());
  if (format != "mcap" && format != "csv")
    return router_.fail(call, "`format` must be \"mcap\" or \"csv\"");
  const auto path = folder_.path_of(file);
  if (!path) return router_.fail(call, path.error().text());
  std::error_code error;
  if (root_.empty() || !fs::is_regular_file(*path, error))
    return router_.fail(call, "there is no recording " + file);
  if (format == "mcap") {
    return finish(call, key, Made{.download = {*path, file, "application/octet-stream", nullptr}});
  }
  const auto own_count = std::ranges::count_if(
      making_, [&](const auto& one) { return one.first.first == call.connection_id; });
  if (making_.size() >= kAllCountMax || static_cast<std::size_t>(own_count) >= kOwnCountMax)
    return router_.fail(call, "too many downloads are being made; wait until one is complete");
  const auto making = std::make_shared<Making>();
  if (!making_.emplace(key, making).second)
    return router_.fail(call, "a download with this id is being made");
  const bool is_queued = workers_.run("exports", [this, call, key, making, options, path = *path] {
    auto made = std::make_shared<expected<Made, SetupError>>(make_tables(path, options, *making));
    post_([this, call, key, made] { finish(call, key, std::move(*made)); });
  });
  if (is_queued) return;
  making_.erase(key);
  router_.fail(call, "too much waits to be done; try again");
}

void DownloadDesk::finish(const PendingCall& call, const Key& key,
                          expected<Made, SetupError> made) {
  bool is_cancelled = false;
  if (const auto found = making_.find(key); found != making_.end()) {
    is_cancelled = found->second->is_cancelled;
    making_.erase(found);
  }
  if (is_cancelled) return router_.fail(call, "the download was cancelled");
  if (!made) return router_.fail(call, made.error().text());
  const exports::Report report = std::move(made->report);
  const std::string name = made->download.name;
  std::error_code ignored;
  const std::uint64_t byte_count = fs::file_size(made->download.path, ignored);
  const auto ticket = tickets_.add(call.connection_id, std::move(made->download), rt::now());
  if (!ticket) return router_.fail(call, ticket.error().text());
  OrderedJson left_out = OrderedJson::array();
  for (const exports::LeftOut& each : report.left_out) {
    left_out.push_back(
        {{"topic", each.topic}, {"reason", each.reason}, {"message_count", each.message_count}});
  }
  router_.succeed(call, OrderedJson{{"path", "/download/" + *ticket + "/" + name},
                                    {"name", name},
                                    {"byte_count", byte_count},
                                    {"late_count", report.late_count},
                                    {"left_out", std::move(left_out)}});
}

void DownloadDesk::show_choices(const PendingCall& call, const Json& request) {
  const std::string file = Fields(request).text("file");
  const auto path = folder_.path_of(file);
  if (!path) return router_.fail(call, path.error().text());
  const bool is_queued = workers_.run("choices", [this, call, path = *path] {
    const recording::Progress go_on = [this](auto, auto) { return !is_ending_; };
    OrderedJson reply;
    std::string problem;
    if (auto reader =
            recording::FileReader::open(path.string(), recording::Incomplete::kRefuse, go_on);
        !reader) {
      problem = reader.error().text();
    } else if (auto notes = recording::read_notes(path.string()); !notes) {
      problem = notes.error().text();
    } else if (const auto choices = exports::choices_of(**reader, std::move(*notes), go_on)) {
      reply = {{"topics", choices->topics},
               {"trials", choices->trials},
               {"conditions", choices->conditions},
               {"marks", choices->marks}};
    } else {
      problem = choices.error().text();
    }
    post_([this, call, reply, problem] {
      if (!problem.empty()) return router_.fail(call, problem);
      router_.succeed(call, reply);
    });
  });
  if (!is_queued) router_.fail(call, "too much waits to be done; try again");
}

recording::Progress DownloadDesk::progress(Making& making, double from, double to) const {
  return [this, &making, from, to](std::uint64_t done, std::uint64_t whole) {
    const double part =
        whole == 0 ? 0 : std::min(static_cast<double>(done) / static_cast<double>(whole), 1.0);
    making.part = std::max(making.part.load(), from + part * (to - from));
    return !is_ending_ && !making.is_cancelled;
  };
}

expected<std::shared_ptr<MadeFolder>, SetupError> DownloadDesk::make_folder() const {
  std::string path = (root_ / kFolderBegin).string() + std::to_string(::getpid()) + "-XXXXXX";
  if (::mkdtemp(path.data()) == nullptr) {
    return setup_error("tables can't be made in '" + printable(root_.string()) + "'",
                       system_error(errno));
  }
  return std::make_shared<MadeFolder>(path);
}

expected<DownloadDesk::Made, SetupError> DownloadDesk::make_tables(const fs::path& recording,
                                                                   exports::TableOptions options,
                                                                   Making& making) const {
  if (is_ending_ || making.is_cancelled)
    return setup_error("the tables were not made", "it was stopped");
  auto folder = make_folder();
  if (!folder) return unexpected{folder.error()};
  const auto reader = recording::FileReader::open(
      recording.string(), recording::Incomplete::kRefuse, progress(making, 0, 0));
  if (!reader) return unexpected{reader.error()};
  auto notes = recording::read_notes(recording.string());
  if (!notes) return unexpected{notes.error()};
  options.notes = std::move(*notes);
  const fs::path tables = (*folder)->path() / "tables";
  const double table_part = options.is_joined ? 1 : kTablePart;
  auto report =
      exports::export_csv(**reader, tables.string(), options, progress(making, 0, table_part));
  if (!report) return unexpected{report.error()};
  const std::string stem = recording.stem().string();
  if (options.is_joined) {
    return Made{.download = {tables / "joined.csv", stem + ".csv", "text/csv; charset=utf-8",
                             std::move(*folder)},
                .report = std::move(*report)};
  }
  const fs::path zip = (*folder)->path() / "tables.zip";
  if (auto zipped =
          exports::zip_folder(tables.string(), zip.string(), progress(making, table_part, 1));
      !zipped) {
    return unexpected{zipped.error()};
  }
  return Made{.download = {zip, stem + ".zip", "application/zip", std::move(*folder)},
              .report = std::move(*report)};
}

}  // namespace rtpm::console
