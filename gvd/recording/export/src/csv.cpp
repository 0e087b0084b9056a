#include <cerrno>
#include <charconv>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "left_out.hpp"
#include "read_all.hpp"
#include "rows.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/exports/export.hpp"
#include "rtpm/exports/scalars.hpp"
#include "sample_names.hpp"

namespace rtpm::exports {
namespace {

namespace fs = std::filesystem;

/// A file's lines are kept up to this size, and then appended to it.
constexpr std::size_t kHeldByteMax = std::size_t{1} << 16;
constexpr std::size_t kFileNameSizeMax = 200;

/// "lab_arm0_sampled", from "lab/arm0/sampled".
std::string file_stem(const std::string& topic) {
  std::string stem = topic.substr(0, kFileNameSizeMax);
  for (char& c : stem) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                          (c >= '0' && c <= '9') || c == '-' || c == '.';
    if (!is_plain) c = '_';
  }
  if (stem.empty() || stem.front() == '.') stem.insert(0, "_");
  return stem;
}

/// Appends a cell that is not a number: in quotation marks where RFC 4180 demands them. A text that
/// a spreadsheet would run as a formula gets an apostrophe.
void append_text_cell(std::string& line, const std::string& text) {
  constexpr std::string_view kFormulaMarks = "=+-@";
  double ignored = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), ignored);
  const bool is_number = parsed.ec == std::errc{} && parsed.ptr == text.data() + text.size();
  const bool is_formula =
      !text.empty() && kFormulaMarks.find(text.front()) != std::string_view::npos && !is_number;
  if (!is_formula && text.find_first_of(",\"\r\n") == std::string::npos) {
    line += text;
    return;
  }
  line += is_formula ? "\"'" : "\"";
  for (const char c : text) {
    if (c == '"') line += '"';
    line += c;
  }
  line += '"';
}

/// "2026-11-24T08:15:30.250123456Z".
std::string time_text(std::uint64_t ns) {
  const auto whole_s = static_cast<std::time_t>(ns / 1'000'000'000);
  std::tm utc{};
  ::gmtime_r(&whole_s, &utc);
  std::string text(32, '\0');
  text.resize(std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S.", &utc));
  const std::string fraction = std::to_string(ns % 1'000'000'000);
  return text + std::string(9 - fraction.size(), '0') + fraction + "Z";
}

/// Seconds from `begin_ns`, with all digits: "-0.000000001".
std::string seconds_text(std::uint64_t ns, std::uint64_t begin_ns) {
  const bool is_before = ns < begin_ns;
  const std::uint64_t span = is_before ? begin_ns - ns : ns - begin_ns;
  const std::string fraction = std::to_string(span % 1'000'000'000);
  return (is_before ? "-" : "") + std::to_string(span / 1'000'000'000) + "." +
         std::string(9 - fraction.size(), '0') + fraction;
}

/// The file of one channel.
struct Table {
  std::string topic{};
  std::string file{};
  std::unique_ptr<Rows> rows{};  ///< nullptr: the messages are JSON.
  std::vector<bool> is_shown{};  ///< By column.
  std::string lines{};           ///< Not yet in the file.
  std::uint64_t message_count = 0;
};

class CsvExport {
 public:
  CsvExport(recording::FileReader& reader, fs::path folder, const recording::Progress& progress)
      : reader_(reader), folder_(std::move(folder)), progress_(progress) {}

  expected<Report, SetupError> run() {
    const auto devices = read_devices(reader_, progress_);
    if (!devices) return unexpected{devices.error()};
    recording::Query query;
    for (const auto& [number, channel] : reader_.channels()) {
      if (open(number, channel, *devices)) query.channel_ids.push_back(number);
    }
    if (!query.channel_ids.empty()) {
      if (auto written = write_all(query); !written) return unexpected{written.error()};
    }
    if (auto written = write_summary(); !written) return unexpected{written.error()};
    Report report{.topic_count = tables_.size(), .left_out = left_out_.all()};
    for (const auto& [number, table] : tables_)
      report.message_count += table.message_count;
    return report;
  }

 private:
  bool open(std::uint16_t number, const recording::Channel& channel, const Devices& devices) {
    if (is_view(channel)) return false;
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
    table.lines = header(table, device_of(devices, reader_, channel));
    table.file = free_name(file_stem(channel.topic));
    tables_.emplace(number, std::move(table));
    return true;
  }

  static std::string header(Table& table, const driver::Descriptor* device) {
    std::string line = "time [UTC],seconds [s],message";
    if (table.rows == nullptr) return line + ",json\r\n";
    for (const Column& column : table.rows->columns()) {
      ColumnName name =
          device == nullptr ? ColumnName{column.name, ""} : name_by_device(*device, column.name);
      table.is_shown.push_back(!name.name.empty());
      if (name.name.empty()) continue;
      if (!column.unit.empty()) name.unit = column.unit;
      if (!name.unit.empty()) name.name += " [" + name.unit + "]";
      line += ',';
      append_text_cell(line, printable(name.name));
    }
    return line + "\r\n";
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
    for (auto& [number, table] : tables_) {
      if (auto flushed = flush(table); !flushed) return flushed;
    }
    return {};
  }

  expected<void, SetupError> add(const recording::Message& message) {
    Table& table = tables_.at(message.channel_id);
    if (table.rows != nullptr && !table.rows->read(message.data, cells_)) {
      left_out_.add(table.topic, kBrokenMessage, 1);
      return {};
    }
    std::string& lines = table.lines;
    lines += time_text(message.publish_time_ns) + "," +
             seconds_text(message.publish_time_ns, reader_.statistics().begin_ns) + "," +
             std::to_string(message.sequence);
    if (table.rows == nullptr) {
      lines += ',';
      append_text_cell(lines, printable_lines({reinterpret_cast<const char*>(message.data.data()),
                                               message.data.size()}));
    }
    for (std::size_t i = 0; i < table.is_shown.size(); ++i) {
      if (!table.is_shown[i]) continue;
      lines += ',';
      if (table.rows->columns()[i].kind == Column::Kind::kNumber) {
        lines += cells_[i];
      } else {
        append_text_cell(lines, printable_lines(cells_[i]));
      }
    }
    lines += "\r\n";
    ++table.message_count;
    return lines.size() < kHeldByteMax ? expected<void, SetupError>{} : flush(table);
  }

  expected<void, SetupError> flush(Table& table) {
    auto written = append(table.file, table.lines);
    table.lines.clear();
    return written;
  }

  /// Opens the file each time, as a recording can have more channels than a process files.
  [[nodiscard]] expected<void, SetupError> append(const std::string& name,
                                                  const std::string& text) const {
    std::ofstream file(folder_ / name, std::ios::app | std::ios::binary);
    file << text << std::flush;
    if (file) return {};
    return setup_error("'" + (folder_ / name).string() + "' can't be written", system_error(errno));
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
  const recording::Progress& progress_;
  std::map<std::uint16_t, Table> tables_{};
  std::set<std::string> names_{};
  std::vector<std::string> cells_{};
  LeftOutCounter left_out_{};
};

}  // namespace

expected<Report, SetupError> export_csv(recording::FileReader& reader, const std::string& folder,
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
  auto report = CsvExport(reader, draft, progress).run();
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
