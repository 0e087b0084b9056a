#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "course.hpp"
#include "csv_text.hpp"
#include "left_out.hpp"
#include "read_all.hpp"
#include "rows.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/exports/export.hpp"
#include "rtpm/exports/scalars.hpp"
#include "rtpm/program/text.hpp"
#include "sample_names.hpp"
#include "sheet.hpp"

namespace rtpm::exports {
namespace {

namespace fs = std::filesystem;

/// A file's lines are kept up to this size, and then appended to it.
constexpr std::size_t kHeldByteMax = std::size_t{1} << 16;
/// Values wait for earlier ones of other topics, so long and so many bytes in all.
constexpr std::uint64_t kOrderNs = 1'000'000'000;
constexpr std::size_t kOrderByteMax = std::size_t{1} << 26;
/// Names that are kept for a suggestion.
constexpr std::size_t kNameCountMax = 4096;

/// The topics and columns that TableOptions choose.
class Choice {
 public:
  explicit Choice(const TableOptions& options)
      : options_(options),
        is_topic_used_(options.topics.size()),
        is_column_used_(options.columns.size()) {}

  [[nodiscard]] bool takes_topic(const std::string& topic, const std::string& device) {
    for (const std::string& name : {topic, device}) {
      if (!name.empty() && topics_.size() < kNameCountMax) topics_.insert(name);
    }
    bool is_taken = options_.topics.empty();
    for (std::size_t i = 0; i < options_.topics.size(); ++i) {
      const std::string& pattern = options_.topics[i];
      const bool is_match =
          is_like(topic, pattern) || (!device.empty() && is_like(device, pattern));
      is_taken = is_taken || is_match;
      is_topic_used_[i] = is_topic_used_[i] || is_match;
    }
    return is_taken;
  }

  [[nodiscard]] bool takes_column(const std::string& table, const std::string& name) {
    if (columns_.size() < kNameCountMax) columns_.insert(name);
    bool is_taken = options_.columns.empty();
    for (std::size_t i = 0; i < options_.columns.size(); ++i) {
      const std::string& pattern = options_.columns[i];
      const bool is_match = is_like(name, pattern) || is_like(table + "." + name, pattern);
      is_taken = is_taken || is_match;
      is_column_used_[i] = is_column_used_[i] || is_match;
    }
    return is_taken;
  }

  /// @errors   a pattern that nothing is like
  [[nodiscard]] expected<void, SetupError> check() const {
    for (std::size_t i = 0; i < options_.topics.size(); ++i) {
      if (!is_topic_used_[i]) return failure("topic", options_.topics[i], topics_);
    }
    for (std::size_t i = 0; i < options_.columns.size(); ++i) {
      if (!is_column_used_[i]) return failure("column", options_.columns[i], columns_);
    }
    return {};
  }

 private:
  static unexpected<SetupError> failure(const std::string& kind, const std::string& pattern,
                                        const std::set<std::string>& names) {
    return setup_error("no " + kind + " is like '" + printable(pattern) + "'" +
                           program::suggestion(pattern, {names.begin(), names.end()}),
                       "", "see `rtpm bag info` for topics; `*` stands for any text");
  }

  const TableOptions& options_;
  std::vector<bool> is_topic_used_;
  std::vector<bool> is_column_used_;
  std::set<std::string> topics_{};
  std::set<std::string> columns_{};
};

/// The table of one channel.
struct Table {
  std::string topic{};
  std::string file{};
  std::unique_ptr<Rows> rows{};  ///< nullptr: the messages are JSON.
  std::vector<std::string> header{};
  std::string lines{};     ///< Not yet in the file.
  Sheet* sheet = nullptr;  ///< Which holds its values; nullptr: its messages are rows.
  std::size_t source = 0;  ///< In the sheet.
  std::uint64_t message_count = 0;
};

/// A value or event that waits for earlier ones.
struct Waiting {
  std::uint64_t time_ns = 0;
  std::uint64_t order = 0;
  std::optional<CourseEvent> event{};
  Table* table = nullptr;
  std::string cells{};

  [[nodiscard]] std::size_t byte_count() const noexcept {
    const std::size_t texts =
        event ? event->condition.size() + event->response.size() + event->note.size() : 0;
    return sizeof *this + cells.size() + texts;
  }
  /// Puts the first one at the front of a heap.
  [[nodiscard]] bool operator<(const Waiting& other) const noexcept {
    return std::pair(time_ns, order) > std::pair(other.time_ns, other.order);
  }
};

class CsvExport {
 public:
  CsvExport(recording::FileReader& reader, fs::path folder, const TableOptions& options,
            const recording::Progress& progress)
      : reader_(reader),
        folder_(std::move(folder)),
        options_(options),
        progress_(progress),
        choice_(options),
        course_(reader, options.notes) {}

  expected<Report, SetupError> run() {
    if (auto known = read_facts(); !known) return unexpected{known.error()};
    recording::Query query = query_of(intervals_);
    for (const auto& [number, channel] : reader_.channels()) {
      if (open(number, channel)) query.channel_ids.push_back(number);
    }
    if (auto checked = choice_.check(); !checked) return unexpected{checked.error()};
    if (auto begun = begin_sheets(); !begun) return unexpected{begun.error()};
    for (const std::uint16_t number : course_.channel_ids()) {
      if (!tables_.contains(number)) query.channel_ids.push_back(number);
    }
    if (auto written = write_notes(); !written) return unexpected{written.error()};
    if (!query.channel_ids.empty()) {
      if (auto written = write_all(query); !written) return unexpected{written.error()};
    }
    if (auto written = write_summary(); !written) return unexpected{written.error()};
    return report();
  }

 private:
  expected<void, SetupError> read_facts() {
    const recording::Statistics& statistics = reader_.statistics();
    // These passes are short, beside the one over all messages.
    const recording::Progress go_on = [this](std::uint64_t, std::uint64_t whole) {
      return !progress_ || progress_(0, whole);
    };
    auto devices = read_devices(reader_, go_on);
    if (!devices) return unexpected{devices.error()};
    devices_ = std::move(*devices);
    auto intervals = intervals_of(reader_, course_, options_.part, go_on);
    if (!intervals) return unexpected{intervals.error()};
    intervals_ = std::move(*intervals);
    double length_s = 0;
    for (const Interval& each : intervals_) {
      const std::uint64_t from_ns = std::max(each.from_ns, statistics.begin_ns);
      const std::uint64_t to_ns = std::min(each.to_ns, statistics.end_ns);
      if (from_ns < to_ns) length_s += static_cast<double>(to_ns - from_ns) * 1e-9;
    }
    if (length_s * options_.rate_hz > kRowCountMax) {
      return setup_error("a table can't have so many rows",
                         program::formatted("%.0f s at %g Hz are more than %g", length_s,
                                            options_.rate_hz, kRowCountMax),
                         "export a part of the recording, or choose a lower rate");
    }
    return {};
  }

  [[nodiscard]] bool is_joinable(std::uint16_t number, const recording::Channel& channel) const {
    const std::string kind = capture::value_of(channel, capture::kKindKey);
    return channel.message_encoding != "json" && kind != capture::kDescriptionKind &&
           kind != capture::kMediumKind && !course_.has(number);
  }

  bool open(std::uint16_t number, const recording::Channel& channel) {
    const std::string device = capture::value_of(channel, capture::kDeviceKey);
    if (is_view(channel) || !choice_.takes_topic(channel.topic, device)) return false;
    if (options_.is_joined && !is_joinable(number, channel)) return false;
    Table table{.topic = channel.topic};
    const auto schema = reader_.schemas().find(channel.schema_id);
    if (channel.message_encoding != "json") {
      if (schema == reader_.schemas().end() || channel.message_encoding != "flatbuffer") {
        left_out_.add(channel.topic, "its encoding '" + channel.message_encoding + "' is unknown",
                      count_of(reader_, number));
        return false;
      }
      auto rows = Rows::make(schema->second);
      if (!rows) {
        left_out_.add(channel.topic, rows.error(), count_of(reader_, number));
        return false;
      }
      table.rows = std::move(*rows);
    }
    name_columns(table, device_of(devices_, reader_, channel), device);
    if (table.header.empty() && !(options_.columns.empty() && !options_.is_joined)) return false;
    const auto [added, is_new] = tables_.emplace(number, std::move(table));
    place(added->second);
    return true;
  }

  /// Names the chosen columns, and forgets the others.
  void name_columns(Table& table, const driver::Descriptor* described, const std::string& device) {
    const std::string prefix = device.empty() || described == nullptr ? table.topic : device;
    if (table.rows == nullptr) {
      if (choice_.takes_column(prefix, "json")) table.header.emplace_back("json");
      return;
    }
    std::vector<bool> is_kept;
    for (const Column& column : table.rows->columns()) {
      ColumnName name = described == nullptr ? ColumnName{column.name, ""}
                                             : name_by_device(*described, column.name);
      const bool is_taken = !name.name.empty() && choice_.takes_column(prefix, name.name) &&
                            !(options_.is_joined && column.kind == Column::Kind::kJson);
      is_kept.push_back(is_taken);
      if (!is_taken) continue;
      if (!column.unit.empty()) name.unit = column.unit;
      const std::string unit = name.unit.empty() ? "" : " [" + name.unit + "]";
      std::string text = printable(name.name) + printable(unit);
      if (options_.is_joined) text = unique_name(prefix, table.topic, text);
      table.header.push_back(std::move(text));
    }
    table.rows->keep(is_kept);
  }

  /// "lab/arm0.position_m.x": columns of one name in several tables stay apart.
  std::string unique_name(const std::string& prefix, const std::string& topic,
                          const std::string& column) {
    for (const std::string& table : {prefix, topic}) {
      std::string name = printable(table) + "." + column;
      if (joined_names_.insert(name).second) return name;
    }
    for (int i = 2;; ++i) {
      std::string name = printable(topic) + "-" + std::to_string(i) + "." + column;
      if (joined_names_.insert(name).second) return name;
    }
  }

  /// Gives the table its file, and the sheet that writes it.
  void place(Table& table) {
    table.file = options_.is_joined ? "joined.csv" : free_name(file_stem(table.topic));
    if (options_.is_joined && !sheets_.empty()) {
      table.sheet = sheets_.front().get();
    } else if (options_.is_joined || options_.rate_hz > 0) {
      table.sheet = sheets_.emplace_back(make_sheet(table.file, options_.is_joined)).get();
    }
    if (table.sheet != nullptr) table.source = table.sheet->add(table.header);
  }

  std::unique_ptr<Sheet> make_sheet(const std::string& file, bool has_course) {
    const recording::Statistics& statistics = reader_.statistics();
    return std::make_unique<Sheet>(Sheet::Config{.begin_ns = statistics.begin_ns,
                                                 .end_ns = statistics.end_ns,
                                                 .rate_hz = options_.rate_hz,
                                                 .has_course = has_course && !course_.is_empty()},
                                   intervals_, folder_ / file);
  }

  expected<void, SetupError> begin_sheets() {
    if (options_.is_joined && sheets_.empty()) sheets_.push_back(make_sheet("joined.csv", true));
    for (const auto& sheet : sheets_) {
      if (auto written = sheet->write_header(); !written) return written;
    }
    for (auto& [number, table] : tables_) {
      if (table.sheet != nullptr) continue;
      table.lines = "time [UTC],seconds [s],message";
      for (const std::string& name : table.header) {
        table.lines += ',';
        append_text_cell(table.lines, name);
      }
      table.lines += "\r\n";
    }
    if (!course_.channel_ids().empty()) {
      trial_lines_ =
          "time [UTC],seconds [s],number,condition,response,seed,end [s],duration [s],note\r\n";
    }
    return {};
  }

  std::string free_name(const std::string& stem) {
    std::string name = stem + ".csv";
    for (int i = 2; !names_.insert(name).second; ++i)
      name = stem + "-" + std::to_string(i) + ".csv";
    return name;
  }

  expected<void, SetupError> write_all(const recording::Query& query) {
    auto done = read_all(reader_, query, progress_, "'" + folder_.string() + "' was not written",
                         [this](const recording::Message& message) { return add(message); });
    if (!done) return done;
    while (!waiting_.empty()) {
      if (auto set = set_first(); !set) return set;
    }
    for (const auto& sheet : sheets_) {
      if (auto finished = sheet->finish(); !finished) return finished;
    }
    for (auto& [number, table] : tables_) {
      if (table.sheet != nullptr) continue;
      if (auto flushed = append(table.file, table.lines); !flushed) return flushed;
    }
    for (const TrialPairs::Trial& trial : trials_.rest()) {
      if (auto added = add_trial(trial); !added) return added;
    }
    return course_.channel_ids().empty() ? done : append("trials.csv", trial_lines_);
  }

  expected<void, SetupError> add(const recording::Message& message) {
    const auto found = tables_.find(message.channel_id);
    const std::uint64_t time_ns = time_of(message);
    if (course_.has(message.channel_id)) {
      if (auto event = course_.read(message)) {
        if (auto added = add_event(*event); !added) return added;
      } else if (found == tables_.end()) {
        left_out_.add(reader_.channels().at(message.channel_id).topic, kBrokenMessage, 1);
      }
    }
    if (found != tables_.end()) {
      Table& table = found->second;
      if (table.sheet == nullptr && !is_inside(intervals_, time_ns)) return {};
      if (table.rows != nullptr && !table.rows->read(message.data, cells_)) {
        left_out_.add(table.topic, kBrokenMessage, 1);
        return {};
      }
      if (is_inside(intervals_, time_ns)) ++table.message_count;
      if (table.sheet == nullptr) return add_row(table, message);
      push({.time_ns = time_ns, .table = &table, .cells = cells_of(table, message)});
    }
    while (!waiting_.empty() && (waiting_.front().time_ns + kOrderNs <= message.log_time_ns ||
                                 waiting_byte_count_ > kOrderByteMax)) {
      if (auto set = set_first(); !set) return set;
    }
    return {};
  }

  static std::string json_cell(const recording::Message& message) {
    std::string cell;
    append_text_cell(cell, printable_lines({reinterpret_cast<const char*>(message.data.data()),
                                            message.data.size()}));
    return cell;
  }

  /// The cells of a message that was read.
  std::string cells_of(const Table& table, const recording::Message& message) {
    if (table.rows == nullptr) return json_cell(message);
    std::string line;
    for (std::size_t i = 0; i < table.header.size(); ++i) {
      if (i > 0) line += ',';
      if (table.rows->columns()[i].kind == Column::Kind::kNumber) {
        line += cells_[i];
      } else {
        append_text_cell(line, printable_lines(cells_[i]));
      }
    }
    return line;
  }

  expected<void, SetupError> add_row(Table& table, const recording::Message& message) {
    std::string& lines = table.lines;
    lines += time_text(message.publish_time_ns) + "," +
             seconds_text(message.publish_time_ns, reader_.statistics().begin_ns) + "," +
             std::to_string(message.sequence);
    if (!table.header.empty()) lines += ',';
    lines += cells_of(table, message) + "\r\n";
    return flush(table.file, lines);
  }

  /// Writes the part's notes, which the joined table has among its marks, too.
  expected<void, SetupError> write_notes() {
    std::string lines;
    for (const CourseEvent& note : course_.notes()) {
      if (!is_inside(intervals_, note.time_ns)) continue;
      if (options_.is_joined) push({.time_ns = note.time_ns, .event = note});
      lines += time_text(note.time_ns) + "," +
               seconds_text(note.time_ns, reader_.statistics().begin_ns) + ",";
      append_text_cell(lines, printable_lines(note.note));
      lines += "\r\n";
    }
    if (lines.empty()) return {};
    return append("notes.csv", "time [UTC],seconds [s],note\r\n" + lines);
  }

  expected<void, SetupError> add_event(const CourseEvent& event) {
    if (options_.is_joined) push({.time_ns = event.time_ns, .event = event});
    if (const auto ended = trials_.add(event)) return add_trial(*ended);
    return {};
  }

  /// A line of trials.csv, if a part of the trial is exported.
  expected<void, SetupError> add_trial(const TrialPairs::Trial& trial) {
    const std::uint64_t begin_ns = reader_.statistics().begin_ns;
    const std::uint64_t end_ns = trial.end_ns.value_or(UINT64_MAX);
    const bool is_chosen = std::ranges::any_of(intervals_, [&](const Interval& each) {
      return trial.begin_ns < each.to_ns && end_ns >= each.from_ns;
    });
    if (!is_chosen) return {};
    std::string& lines = trial_lines_;
    lines += time_text(trial.begin_ns) + "," + seconds_text(trial.begin_ns, begin_ns) + "," +
             std::to_string(trial.event.number) + ",";
    append_text_cell(lines, printable_lines(trial.event.condition));
    lines += ',';
    append_text_cell(lines, printable_lines(trial.event.response));
    lines += "," + trial.event.seed + ",";
    if (trial.end_ns) {
      lines += seconds_text(*trial.end_ns, begin_ns) + "," +
               seconds_text(trial.event.duration_ns.value_or(*trial.end_ns - trial.begin_ns), 0);
    } else {
      lines += ',';
    }
    lines += ',';
    append_text_cell(lines, printable_lines(trial.event.note));
    lines += "\r\n";
    return flush("trials.csv", lines);
  }

  void push(Waiting waiting) {
    waiting.order = ++order_;
    waiting.cells.shrink_to_fit();  // Spare capacity would be as large again.
    waiting_byte_count_ += waiting.byte_count();
    waiting_.push_back(std::move(waiting));
    std::push_heap(waiting_.begin(), waiting_.end());
  }

  expected<void, SetupError> set_first() {
    std::pop_heap(waiting_.begin(), waiting_.end());
    Waiting first = std::move(waiting_.back());
    waiting_.pop_back();
    waiting_byte_count_ -= first.byte_count();
    if (first.event) return sheets_.front()->set(first.time_ns, *first.event);
    return first.table->sheet->set(first.time_ns, first.table->source, std::move(first.cells));
  }

  Report report() {
    Report report{.topic_count = tables_.size(), .left_out = left_out_.all()};
    for (const auto& [number, table] : tables_)
      report.message_count += table.message_count;
    for (const auto& sheet : sheets_) {
      report.row_count += sheet->row_count();
      report.late_count += sheet->late_count();
    }
    return report;
  }

  expected<void, SetupError> flush(const std::string& file, std::string& lines) {
    if (lines.size() < kHeldByteMax) return {};
    auto written = append(file, lines);
    lines.clear();
    return written;
  }

  [[nodiscard]] expected<void, SetupError> append(const std::string& name,
                                                  const std::string& text) const {
    return append_to_file(folder_ / name, text);
  }

  /// The facts on the whole recording, such as those of clocks, which tables have no place for.
  expected<void, SetupError> write_summary() {
    const auto metadata = reader_.read_metadata();
    if (!metadata) return unexpected{metadata.error()};
    const recording::Statistics& statistics = reader_.statistics();
    std::string json = "{\"begin\":\"" + time_text(statistics.begin_ns) + "\",\"end\":\"" +
                       time_text(statistics.end_ns) + "\",\"channels\":[";
    const char* separator = "\n";
    for (const auto& [number, table] : tables_) {
      const recording::Channel& channel = reader_.channels().at(number);
      const auto schema = reader_.schemas().find(channel.schema_id);
      json += std::exchange(separator, ",\n");
      append_object(json,
                    {{"file", table.file},
                     {"topic", table.topic},
                     {"type", schema == reader_.schemas().end() ? "" : schema->second.name},
                     {"message_count", std::to_string(table.message_count)}},
                    channel.metadata);
    }
    json += "],\"metadata\":[";
    separator = "\n";
    for (const recording::Metadata& each : *metadata) {
      json += std::exchange(separator, ",\n");
      append_object(json, {{"name", each.name}}, each.values);
    }
    return append("recording.json", json + "]}\n");
  }

  static void append_object(std::string& json,
                            const std::vector<std::pair<std::string, std::string>>& texts,
                            const std::map<std::string, std::string>& values) {
    json += '{';
    for (const auto& [name, text] : texts) {
      append_json_text(json, name);
      json += ':';
      append_json_text(json, text);
      json += ',';
    }
    json += "\"values\":{";
    for (bool is_first = true; const auto& [name, text] : values) {
      if (!std::exchange(is_first, false)) json += ',';
      append_json_text(json, name);
      json += ':';
      append_json_text(json, text);
    }
    json += "}}";
  }

  recording::FileReader& reader_;
  fs::path folder_;
  const TableOptions& options_;
  const recording::Progress& progress_;
  Choice choice_;
  Course course_;
  Devices devices_{};
  std::vector<Interval> intervals_{};
  std::map<std::uint16_t, Table> tables_{};
  std::vector<std::unique_ptr<Sheet>> sheets_{};
  std::set<std::string> names_{"joined.csv", "trials.csv", "notes.csv"};
  std::set<std::string> joined_names_{};
  std::vector<std::string> cells_{};
  std::vector<Waiting> waiting_{};  ///< A heap.
  std::size_t waiting_byte_count_ = 0;
  std::uint64_t order_ = 0;
  TrialPairs trials_{};
  std::string trial_lines_{};
  LeftOutCounter left_out_{};
};

}  // namespace

expected<Report, SetupError> export_csv(recording::FileReader& reader, const std::string& folder,
                                        const TableOptions& options,
                                        const recording::Progress& progress) {
  const std::string what = "'" + folder + "' can't be written";
  const std::string draft = folder + ".part";
  std::error_code cause;
  for (const std::string& path : {folder, draft}) {
    if (fs::exists(path, cause))
      return setup_error(what, "'" + path + "' exists already",
                         "choose another name, or remove it");
  }
  fs::create_directory(draft, cause);
  if (cause) return setup_error(what, cause);
  auto report = CsvExport(reader, draft, options, progress).run();
  if (report) {
    fs::rename(draft, folder, cause);
    if (!cause) return report;
    report = setup_error(what, cause);
  }
  std::error_code ignored;
  fs::remove_all(draft, ignored);
  return report;
}

}  // namespace rtpm::exports
