#include "review/review_desk.hpp"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/capture/cut.hpp"
#include "rtpm/recording/notes.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::console {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

/// A window that takes longer is answered from the overview.
constexpr Duration kWindowTimeMax = std::chrono::seconds{5};
constexpr std::size_t kWindowFieldCountMax = 64;
/// An incomplete recording that changed more recently is still being recorded.
constexpr std::chrono::seconds kWrittenAge{10};
constexpr std::string_view kQueueFull = "too much waits to be done; try again";

std::string requested_text(const nlohmann::json& request, const char* key) {
  const auto found = request.find(key);
  return found != request.end() && found->is_string() ? found->get<std::string>() : std::string{};
}

/// A whole number that is not negative; nullopt if there is none.
std::optional<std::uint64_t> requested_count(const nlohmann::json& request, const char* key) {
  const auto found = request.find(key);
  if (found == request.end() || !found->is_number_unsigned()) return std::nullopt;
  return found->get<std::uint64_t>();
}

/// Reads the request of a window.
/// @errors   what it lacks, as a sentence
expected<Review::Window, std::string> read_window(const nlohmann::json& request) {
  const auto begin = requested_count(request, "begin_ns");
  const auto end = requested_count(request, "end_ns");
  const auto points = requested_count(request, "points");
  if (!begin || !end || *begin >= *end) {
    return unexpected{std::string("review_series needs `begin_ns` and a later `end_ns`")};
  }
  Review::Window window{.begin_ns = *begin, .end_ns = *end};
  const auto fields = request.find("fields");
  std::set<std::string> known;
  if (fields != request.end() && fields->is_array()) {
    for (const nlohmann::json& each : *fields) {
      if (!each.is_string() || !known.insert(each.get<std::string>()).second) continue;
      window.fields.push_back(each.get<std::string>());
    }
  }
  if (window.fields.empty() || window.fields.size() > kWindowFieldCountMax) {
    return unexpected{std::string("review_series needs 1 to 64 `fields`")};
  }
  if (!points || *points == 0) return unexpected{std::string("review_series needs `points`")};
  window.point_count = static_cast<std::size_t>(
      std::min<std::uint64_t>(*points, Review::kPointCountMax / window.fields.size()));
  return window;
}

/// Whether another program seems to record it at present.
bool is_being_written(const fs::path& path) {
  std::error_code error;
  const auto time = fs::last_write_time(path, error);
  if (error || fs::file_time_type::clock::now() - time > kWrittenAge) return false;
  const auto outline = recording::read_outline(path.string());
  return outline && !outline->is_complete;
}

OrderedJson notes_json(const std::vector<recording::Note>& notes) {
  OrderedJson list = OrderedJson::array();
  for (const recording::Note& note : notes) {
    list.push_back({{"time_ns", note.time_ns},
                    {"text", printable_lines(note.text)},
                    {"made_ns", note.made_ns}});
  }
  return list;
}

/// A new note, or the removal of one.
struct NoteChange {
  std::uint64_t time_ns = 0;
  std::string text{};            ///< Empty: the note of this time is removed
  std::uint64_t removed_ns = 0;  ///< that was made then.
};

/// Changes a recording's notes; returns all of them.
expected<OrderedJson, SetupError> change_notes(const std::string& path, const NoteChange& change) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) {
    return setup_error("there is no recording '" + fs::path(path).filename().string() + "'");
  }
  auto notes = recording::read_notes(path);
  if (!notes) return unexpected{notes.error()};
  if (change.text.empty()) {
    const std::size_t count = std::erase_if(*notes, [&](const recording::Note& note) {
      return note.time_ns == change.time_ns && note.made_ns == change.removed_ns;
    });
    if (count == 0) return setup_error("the note has no text", "", "write one");
  } else {
    notes->push_back(
        {.time_ns = change.time_ns, .text = change.text, .made_ns = rt::utc_ns(rt::now())});
  }
  if (auto written = recording::write_notes(path, *notes); !written) {
    return unexpected{written.error()};
  }
  std::ranges::stable_sort(*notes, {}, &recording::Note::time_ns);
  return notes_json(*notes);
}

/// Cuts a part out of a recording, with its notes.
expected<OrderedJson, SetupError> cut_file(const std::string& from, const std::string& to,
                                           const recording::Query& part,
                                           const recording::Progress& progress) {
  const auto count = capture::cut(from, to, part, progress);
  if (!count) return unexpected{count.error()};
  return OrderedJson{{"file", fs::path(to).filename().string()}, {"message_count", *count}};
}

}  // namespace

ReviewDesk::ReviewDesk(RecordingFolder& folder, UseOf use_of, CallRouter& router, Post post)
    : folder_(folder), use_of_(std::move(use_of)), router_(router), post_(std::move(post)) {}

expected<void, SetupError> ReviewDesk::start() {
  const auto add = [this](const char* name, auto method) {
    router_.add_json(std::string("console/") + name,
                     [this, method](const PendingCall& call, const Json& request) {
                       (this->*method)(call, request);
                     });
  };
  add("review_open", &ReviewDesk::open);
  add("review_series", &ReviewDesk::series);
  add("recording_cut", &ReviewDesk::cut);
  add("recording_annotate", &ReviewDesk::annotate);
  add_changes();
  return reading_.start(
      {.name = "console-review", .thread_count = 4, .per_target_max = 1, .queued_max = 32});
}

void ReviewDesk::stop() {
  is_ending_ = true;
  reading_.stop();
}

void ReviewDesk::add_changes() {
  router_.add_json("console/recording_rename",
                   [this](const PendingCall& call, const Json& request) {
                     const std::string file = requested_text(request, "file");
                     const std::string name = requested_text(request, "name");
                     if (changeable(call, file).empty()) return;
                     close(file);
                     run(call, [this, file, name]() -> expected<OrderedJson, SetupError> {
                       if (auto renamed = folder_.rename(file, name); !renamed)
                         return unexpected{renamed.error()};
                       return OrderedJson{{"file", name}};
                     });
                   });
  router_.add_json("console/recording_delete",
                   [this](const PendingCall& call, const Json& request) {
                     const std::string file = requested_text(request, "file");
                     if (changeable(call, file).empty()) return;
                     close(file);
                     run(call, [this, file]() -> expected<OrderedJson, SetupError> {
                       const std::uint64_t now_ns = rt::utc_ns(rt::now());
                       auto id = folder_.remove(file, now_ns);
                       if (!id) return unexpected{id.error()};
                       return OrderedJson{{"id", *id}, {"purged", folder_.purge(now_ns)}};
                     });
                   });
  router_.add_json("console/recording_restore", [this](const PendingCall& call,
                                                       const Json& request) {
    run(call, [this, id = requested_text(request, "id")]() -> expected<OrderedJson, SetupError> {
      auto file = folder_.restore(id);
      if (!file) return unexpected{file.error()};
      return OrderedJson{{"file", *file}};
    });
  });
  router_.add_json("console/recordings_purge", [this](const PendingCall& call, const Json&) {
    run(call, [this]() -> expected<OrderedJson, SetupError> {
      return OrderedJson{{"count", folder_.purge_all()}};
    });
  });
}

ReviewDesk::OpenPtr ReviewDesk::find(const std::string& file) {
  const auto found = std::ranges::find(open_, file, [](const OpenPtr& each) { return each->file; });
  if (found == open_.end()) return nullptr;
  std::error_code error;
  const bool is_same = fs::file_size((*found)->path, error) == (*found)->byte_count && !error &&
                       fs::last_write_time((*found)->path, error) == (*found)->time && !error;
  if (!is_same) {
    close(file);
    return nullptr;
  }
  open_.splice(open_.begin(), open_, found);
  return open_.front();
}

void ReviewDesk::close(const std::string& file) {
  for (auto each = open_.begin(); each != open_.end();) {
    if ((*each)->file != file) {
      ++each;
      continue;
    }
    (*each)->is_closed = true;
    each = open_.erase(each);
  }
}

void ReviewDesk::open(const PendingCall& call, const Json& request) {
  const std::string file = requested_text(request, "file");
  const auto path = folder_.path_of(file);
  if (!path) return router_.fail(call, path.error().text());
  if (OpenPtr opened = find(file)) {
    if (opened->review) return answer_open(call, opened);
    opened->waiting.push_back(call);
    return;
  }
  const auto opened = std::make_shared<Open>();
  opened->file = file;
  opened->path = path->string();
  std::error_code error;
  opened->byte_count = fs::is_regular_file(*path, error) ? fs::file_size(*path, error) : 0;
  if (!error) opened->time = fs::last_write_time(*path, error);
  if (error) return router_.fail(call, "there is no recording '" + printable(file) + "'");
  opened->waiting.push_back(call);
  open_.push_front(opened);
  if (open_.size() > kOpenCountMax) close(std::string(open_.back()->file));
  begin(opened);
}

/// Opens the file and then reads its overview, each on its own thread.
void ReviewDesk::begin(const OpenPtr& opened) {
  const recording::Progress goes_on = [this, opened](auto, auto) {
    return !is_ending_ && !opened->is_closed;
  };
  const auto fail = [this, opened](std::string_view why) {
    for (const PendingCall& call : std::exchange(opened->waiting, {}))
      router_.fail(call, why);
    if (!opened->is_closed) close(std::string(opened->file));
  };
  const bool is_queued = reading_.run("open", [this, opened, goes_on, fail] {
    auto review = Review::open(opened->path, goes_on);
    auto notes = recording::read_notes(opened->path);
    post_([this, opened, goes_on, fail, review = std::move(review), notes = std::move(notes)] {
      if (!review) return fail(review.error().text());
      opened->review = *review;
      opened->notes = notes ? notes_json(*notes) : OrderedJson::array();
      if (!notes) opened->notes_problem = notes.error().text();
      const bool is_read = reading_.run("overview", [review = *review, goes_on] {
        static_cast<void>(review->read_overview(goes_on));
      });
      if (!is_read) return fail(kQueueFull);
      for (const PendingCall& call : std::exchange(opened->waiting, {}))
        answer_open(call, opened);
    });
  });
  if (!is_queued) fail(kQueueFull);
}

void ReviewDesk::answer_open(const PendingCall& call, const OpenPtr& opened) {
  OrderedJson answer = opened->review->summary();
  answer["notes"] = opened->notes;
  answer["notes_problem"] = opened->notes_problem;
  answer["cut"] = opened->cut_file.empty() ? OrderedJson()
                                           : OrderedJson{{"file", opened->cut_file},
                                                         {"progress", opened->cut_progress.load()}};
  router_.succeed(call, answer);
}

void ReviewDesk::series(const PendingCall& call, const Json& request) {
  const OpenPtr opened = find(requested_text(request, "file"));
  if (!opened || !opened->review) {
    return router_.fail(call, "the recording is not open; call console/review_open first");
  }
  auto window = read_window(request);
  if (!window) return router_.fail(call, window.error());
  const std::shared_ptr<Review> review = opened->review;
  if (const std::string unknown = review->unknown_in(window->fields); !unknown.empty()) {
    return router_.fail(call, "the recording has no field '" + printable(unknown) + "'");
  }
  if (review->is_overview_fine(*window)) return router_.succeed(call, review->overview(*window));
  const bool is_queued = reading_.run("window", [this, call, opened, review, window = *window] {
    const MonotonicTime end = rt::now() + kWindowTimeMax;
    const auto read = review->read(
        window, [&](auto, auto) { return !is_ending_ && !opened->is_closed && rt::now() < end; });
    OrderedJson answer = read ? *read : review->overview(window);
    answer["problem"] = read ? std::string{} : read.error().text();
    post_([this, call, answer = std::move(answer)] { router_.succeed(call, answer); });
  });
  if (!is_queued) router_.fail(call, kQueueFull);
}

std::string ReviewDesk::changeable(const PendingCall& call, const std::string& file) {
  const auto path = folder_.path_of(file);
  std::string why;
  if (!path) {
    why = path.error().text();
  } else if (why = use_of_(file); why.empty() && is_being_written(*path)) {
    why = file + " is being recorded by another program";
  }
  if (why.empty()) return path->string();
  router_.fail(call, why);
  return {};
}

void ReviewDesk::cut(const PendingCall& call, const Json& request) {
  const std::string file = requested_text(request, "file");
  const auto begin = requested_count(request, "begin_ns");
  const auto end = requested_count(request, "end_ns");
  if (!begin || !end || *begin > *end) {
    return router_.fail(call, "recording_cut needs `begin_ns` and a later `end_ns`");
  }
  const auto from = folder_.path_of(file);
  if (!from) return router_.fail(call, from.error().text());
  const auto to = folder_.path_of(requested_text(request, "name"));
  if (!to) return router_.fail(call, to.error().text());
  const OpenPtr opened = find(file);
  if (opened) {
    if (!opened->cut_file.empty()) {
      return router_.fail(call, opened->cut_file + " is being cut out of it; wait for that");
    }
    opened->cut_file = to->filename().string();
    opened->cut_progress = 0;
  }
  const recording::Progress progress = [this, opened](std::uint64_t done, std::uint64_t whole) {
    if (opened && whole > 0) {
      opened->cut_progress = static_cast<double>(done) / static_cast<double>(whole);
    }
    return !is_ending_;
  };
  const bool is_queued = reading_.run(
      "changes", [this, call, opened, progress, from = from->string(), to = to->string(),
                  part = recording::Query{.from_ns = *begin, .to_ns = *end}] {
        auto done = cut_file(from, to, part, progress);
        post_([this, call, opened, done = std::move(done)] {
          if (opened) opened->cut_file.clear();
          reply(call, done);
        });
      });
  if (is_queued) return;
  if (opened) opened->cut_file.clear();
  router_.fail(call, kQueueFull);
}

void ReviewDesk::annotate(const PendingCall& call, const Json& request) {
  const std::string file = requested_text(request, "file");
  const auto path = folder_.path_of(file);
  if (!path) return router_.fail(call, path.error().text());
  const auto time = requested_count(request, "time_ns");
  if (!time) return router_.fail(call, "recording_annotate needs `time_ns`");
  const NoteChange change{.time_ns = *time,
                          .text = requested_text(request, "text"),
                          .removed_ns = requested_count(request, "made_ns").value_or(0)};
  const bool is_queued = reading_.run("changes", [this, call, file, path = path->string(), change] {
    auto done = change_notes(path, change);
    post_([this, call, file, done = std::move(done)] {
      if (const OpenPtr opened = find(file); opened && done) opened->notes = *done;
      if (!done) return router_.fail(call, done.error().text());
      router_.succeed(call, OrderedJson{{"notes", *done}});
    });
  });
  if (!is_queued) router_.fail(call, kQueueFull);
}

void ReviewDesk::run(const PendingCall& call,
                     std::function<expected<OrderedJson, SetupError>()> work) {
  const bool is_queued = reading_.run("changes", [this, call, work = std::move(work)] {
    post_([this, call, done = work()] { reply(call, done); });
  });
  if (!is_queued) router_.fail(call, kQueueFull);
}

void ReviewDesk::reply(const PendingCall& call, const expected<OrderedJson, SetupError>& done) {
  if (done) return router_.succeed(call, *done);
  router_.fail(call, done.error().text());
}

}  // namespace rtpm::console
