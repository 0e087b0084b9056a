#include "rtpm/exports/bids.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <system_error>
#include <utility>

#include "course.hpp"
#include "csv_text.hpp"
#include "left_out.hpp"
#include "os/file.hpp"
#include "read_all.hpp"
#include "recorded_devices.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/exports/scalars.hpp"

namespace rtpm::exports {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kEventByteMax = std::size_t{1} << 28;
constexpr std::size_t kBlockByteMax = std::size_t{1} << 16;
constexpr const char* kNothing = "n/a";

/// "labarm0": labels in names of files have letters and digits only.
std::string label_of(std::string_view text) {
  std::string label;
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) label += c;
  }
  return label;
}

/// A cell of a table whose columns are separated by tabs.
std::string cell_of(std::string_view text) {
  std::string cell = printable(text, kShownWhole);
  std::ranges::replace(cell, '\t', ' ');
  return cell.empty() ? kNothing : cell;
}

/// The type and component of a channel of motion.
std::pair<std::string, std::string> motion_kind(const std::string& path) {
  const std::size_t dot = path.find('.');
  const std::string part = path.substr(0, dot);
  const std::string axis = dot == std::string::npos ? kNothing : path.substr(dot + 1);
  if (part == "position_m") return {"POS", axis};
  if (part == "orientation") return {"ORNT", "quat_" + axis};
  if (part == "linear_m_per_s") return {"VEL", axis};
  if (part == "angular_rad_per_s") return {"GYRO", axis};
  if (part == "joints") return {"JNTANG", kNothing};
  return {"MISC", kNothing};
}

/// The samples of one device, at a rate.
class SampleFile {
 public:
  SampleFile(std::string of_topic, ScalarReader scalars, std::string file_stem, bool is_packed,
             double at_rate_hz, const Interval& interval)
      : topic(std::move(of_topic)),
        reader(std::move(scalars)),
        stem(std::move(file_stem)),
        rate_hz(at_rate_hz),
        interval_(interval),
        held_(reader.fields().size(), NAN),
        next_(held_.size()),
        is_packed_(is_packed) {}

  /// @return whether the message matches its schema
  [[nodiscard]] bool take(const recording::Message& message) {
    if (!reader.read(message.data, next_)) return false;
    fill(time_of(message));
    std::swap(held_, next_);
    return true;
  }
  /// Adds the rows before `time_ns`, each with the values that are held.
  void fill(std::uint64_t time_ns) {
    const std::uint64_t end_ns = std::min(time_ns, interval_.to_ns);
    for (std::uint64_t at = grid_ns(); at < end_ns; at = grid_ns()) {
      for (std::size_t i = 0; i < held_.size(); ++i) {
        if (i > 0) lines += '\t';
        append(held_[i]);
      }
      lines += '\n';
      ++row_count;
      if (lines.size() >= kBlockByteMax && !flush()) return;
    }
  }
  [[nodiscard]] bool flush() {
    if (is_packed_) {
      if (!lines.empty()) is_written_ = is_written_ && write_packed();
    } else {
      std::ofstream file(path, std::ios::app | std::ios::binary);
      file << lines << std::flush;
      is_written_ = is_written_ && file.good();
    }
    lines.clear();
    return is_written_;
  }
  [[nodiscard]] bool is_written() const noexcept { return is_written_; }

  std::string topic;
  ScalarReader reader;
  std::string stem;  ///< The file, without its ending, in the data set.
  double rate_hz;
  fs::path path{};
  std::string lines{};
  std::uint64_t row_count = 0;

 private:
  [[nodiscard]] std::uint64_t grid_ns() const noexcept {
    return interval_.from_ns +
           static_cast<std::uint64_t>(std::llround(static_cast<double>(row_count) * 1e9 / rate_hz));
  }
  void append(double value) {
    if (std::isnan(value)) {
      lines += kNothing;
      return;
    }
    std::array<char, 32> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    lines.append(digits.data(), end);
  }
  /// Appends a member to the file; readers of gzip take several as one.
  [[nodiscard]] bool write_packed() {
    const int number = os::open_to_append(path);
    const gzFile file = number < 0 ? nullptr : gzdopen(number, "ab6");
    if (file == nullptr) return false;
    const int size = gzwrite(file, lines.data(), static_cast<unsigned>(lines.size()));
    return gzclose(file) == Z_OK && size == static_cast<int>(lines.size());
  }

  Interval interval_;
  std::vector<double> held_;
  std::vector<double> next_;
  bool is_packed_;
  bool is_written_ = true;
};

class BidsExport {
 public:
  BidsExport(recording::FileReader& reader, fs::path folder, const BidsOptions& options,
             const recording::Progress& progress)
      : reader_(reader),
        folder_(std::move(folder)),
        draft_(folder_.string() + ".part"),
        options_(options),
        progress_(progress),
        course_(reader, options.notes),
        begin_ns_(reader.statistics().begin_ns),
        end_ns_(reader.statistics().end_ns) {}

  expected<Report, SetupError> run() {
    std::error_code cause;
    if (fs::exists(draft_, cause)) {
      return setup_error(what(), "'" + printable(draft_.string()) + "' exists already",
                         "remove it");
    }
    auto done = make();
    if (done) done = publish();
    fs::remove_all(draft_, cause);
    if (!done) return unexpected{done.error()};
    report_.left_out = left_out_.all();
    return report_;
  }

 private:
  [[nodiscard]] std::string what() const {
    return "'" + printable(folder_.string()) + "' can't be written";
  }

  expected<void, SetupError> make() {
    if (auto named = name(); !named) return named;
    const double length_s = static_cast<double>(end_ns_ - begin_ns_) * 1e-9;
    if (length_s * std::max(options_.rate_hz, 1.0) > kRowCountMax) {
      return setup_error(what(), "it would have too many rows",
                         "choose a lower rate, or cut the recording by `rtpm bag cut`");
    }
    const auto devices = read_devices(reader_, progress_);
    if (!devices) return unexpected{devices.error()};
    recording::Query query;
    for (const auto& [number, channel] : reader_.channels()) {
      const auto* device = device_of(*devices, reader_, channel);
      if (device != nullptr && add(number, channel, *device)) query.channel_ids.push_back(number);
    }
    for (const std::uint16_t number : course_.channel_ids())
      query.channel_ids.push_back(number);
    if (!query.channel_ids.empty()) {
      auto read = read_all(reader_, query, progress_, what(),
                           [this](const recording::Message& message) { return take(message); });
      if (!read) return read;
    }
    for (auto& [number, file] : files_) {
      file.fill(end_ns_ + 1);
      if (!file.flush()) return failure();
    }
    for (const TrialPairs::Trial& trial : trials_.rest())
      put_trial(trial);
    for (const CourseEvent& note : course_.notes())
      put_mark(note, "note");
    return write_events();
  }

  /// Finds the names of participant and task, and writes the files of the data set.
  expected<void, SetupError> name() {
    const auto metadata = reader_.read_metadata();
    if (!metadata) return unexpected{metadata.error()};
    const auto found = std::ranges::find(*metadata, kSessionMetadata, &recording::Metadata::name);
    const auto value = [&](const std::string& given, const char* key) {
      if (!given.empty() || found == metadata->end()) return given;
      const auto one = found->values.find(key);
      return one == found->values.end() ? std::string() : one->second;
    };
    const std::string participant = label_of(value(options_.participant, "participant"));
    task_name_ = value(options_.task, "experiment");
    if (participant.empty()) {
      return setup_error(what(), "no participant is named",
                         "give a code, such as --participant P07");
    }
    const std::string session = label_of(options_.session);
    std::string task = label_of(task_name_);
    if (task.empty()) task = "recording";
    if (task_name_.empty()) task_name_ = task;
    subject_ = "sub-" + participant;
    inside_ = fs::path(subject_);
    head_ = subject_;
    if (!session.empty()) {
      inside_ /= "ses-" + session;
      head_ += "_ses-" + session;
    }
    scans_ = (inside_ / (head_ + "_scans.tsv")).string();
    head_ += "_task-" + task;
    if (options_.run) run_ = "_run-" + std::to_string(*options_.run);
    return {};
  }

  bool add(std::uint16_t number, const recording::Channel& channel,
           const driver::Descriptor& device) {
    const std::string name = capture::value_of(channel, capture::kDeviceKey);
    const bool is_chosen =
        options_.topics.empty() || std::ranges::any_of(options_.topics, [&](const auto& pattern) {
          return is_like(channel.topic, pattern) || is_like(name, pattern);
        });
    const std::uint64_t count = count_of(reader_, number);
    const double length_s = static_cast<double>(end_ns_ - begin_ns_) * 1e-9;
    if (!is_chosen || count == 0 || length_s <= 0) return false;
    const auto schema = reader_.schemas().find(channel.schema_id);
    auto scalars = ScalarReader::create(schema->second, &device);
    if (!scalars) {
      left_out_.add(channel.topic, scalars.error().text(), count);
      return false;
    }
    double rate_hz = options_.rate_hz;
    if (rate_hz == 0) rate_hz = std::max(1.0, std::round(static_cast<double>(count) / length_s));
    const bool is_physio = device.device_class == driver::DeviceClass::kBiometric;
    std::string label = label_of(name);
    for (int i = 2; !labels_.insert(label).second; ++i)
      label = label_of(name) + std::to_string(i);
    const std::string stem =
        is_physio ? (inside_ / "beh" / (head_ + run_ + "_recording-" + label)).string() + "_physio"
                  : (inside_ / "motion" / (head_ + "_tracksys-" + label + run_)).string();
    auto [added, is_new] =
        files_.emplace(number, SampleFile(channel.topic, std::move(*scalars), stem, is_physio,
                                          rate_hz, Interval{begin_ns_, end_ns_ + 1}));
    SampleFile& file = added->second;
    const std::string data = stem + (is_physio ? ".tsv.gz" : "_motion.tsv");
    file.path = draft_ / data;
    scan_lines_ += fs::path(data).lexically_relative(inside_).generic_string() + "\t" +
                   time_text(begin_ns_) + "\n";
    if (is_physio) {
      describe_physio(file, device);
    } else {
      describe_motion(file, device, name);
    }
    return true;
  }

  void describe_physio(const SampleFile& file, const driver::Descriptor& device) {
    Json json{{"SamplingFrequency", file.rate_hz},
              {"StartTime", 0},
              {"TaskName", task_name_},
              {"ManufacturersModelName", printable(device.model)},
              {"DeviceSerialNumber", printable(device.serial)},
              {"Columns", Json::array()}};
    for (const ScalarField& field : file.reader.fields())
      json["Columns"].push_back(printable(field.path));
    for (const ScalarField& field : file.reader.fields())
      json[printable(field.path)] = {{"Units", field.unit.empty() ? kNothing : field.unit}};
    texts_[file.stem + ".json"] = json.dump(2) + "\n";
  }

  void describe_motion(const SampleFile& file, const driver::Descriptor& device,
                       const std::string& name) {
    std::string channels = "name\tcomponent\ttype\ttracked_point\tunits\n";
    std::map<std::string, int> counts;
    for (const ScalarField& field : file.reader.fields()) {
      const auto [type, component] = motion_kind(field.path);
      ++counts[type];
      channels += cell_of(field.path) + "\t" + component + "\t" + type + "\t" + cell_of(name) +
                  "\t" + cell_of(field.unit) + "\n";
    }
    Json json{{"SamplingFrequency", file.rate_hz},
              {"TaskName", task_name_},
              {"TrackingSystemName", printable(name)},
              {"ManufacturersModelName", printable(device.model)},
              {"DeviceSerialNumber", printable(device.serial)},
              {"RecordingDuration", static_cast<double>(end_ns_ - begin_ns_) * 1e-9},
              {"MotionChannelCount", file.reader.fields().size()},
              {"TrackedPointsCount", 1}};
    for (const auto& [type, count] : counts)
      json[type + "ChannelCount"] = count;
    texts_[file.stem + "_motion.json"] = json.dump(2) + "\n";
    texts_[file.stem + "_channels.tsv"] = channels;
  }

  expected<void, SetupError> take(const recording::Message& message) {
    if (course_.has(message.channel_id)) {
      auto event = course_.read(message);
      if (!event) {
        left_out_.add(reader_.channels().at(message.channel_id).topic, kBrokenMessage, 1);
      } else if (event->kind == CourseEvent::Kind::kMark) {
        put_mark(*event, "marker");
      } else if (const auto ended = trials_.add(std::move(*event))) {
        put_trial(*ended);
      }
      if (event_byte_count_ > kEventByteMax) {
        return setup_error(what(), "its trials, marks and notes need more than 256 MiB",
                           "cut the recording into parts by `rtpm bag cut`");
      }
      return {};
    }
    SampleFile& file = files_.at(message.channel_id);
    if (!fs::exists(file.path.parent_path())) {
      std::error_code cause;
      fs::create_directories(file.path.parent_path(), cause);
      if (cause) return setup_error(what(), cause);
    }
    if (file.take(message)) {
      ++report_.message_count;
    } else {
      left_out_.add(file.topic, kBrokenMessage, 1);
    }
    return file.is_written() ? expected<void, SetupError>{} : failure();
  }

  void put(std::uint64_t time_ns, std::string line) {
    event_byte_count_ += sizeof(std::pair<std::uint64_t, std::string>) + line.size();
    events_.emplace_back(time_ns, std::move(line));
    ++report_.row_count;
  }
  void put_mark(const CourseEvent& event, const char* type) {
    put(event.time_ns, seconds_text(event.time_ns, begin_ns_) + "\t0\t" + type + "\t" +
                           (event.number == 0 ? kNothing : std::to_string(event.number)) + "\t" +
                           kNothing + "\t" + kNothing + "\t" + kNothing + "\t" +
                           cell_of(event.note) + "\n");
  }
  void put_trial(const TrialPairs::Trial& trial) {
    const CourseEvent& event = trial.event;
    const std::string duration =
        trial.end_ns ? seconds_text(event.duration_ns.value_or(*trial.end_ns - trial.begin_ns), 0)
                     : kNothing;
    put(trial.begin_ns, seconds_text(trial.begin_ns, begin_ns_) + "\t" + duration + "\t" +
                            (event.condition.empty() ? "trial" : cell_of(event.condition)) + "\t" +
                            std::to_string(event.number) + "\t" + cell_of(event.response) + "\t" +
                            (event.response.empty() ? kNothing : duration) + "\t" +
                            cell_of(event.seed) + "\t" + cell_of(event.note) + "\n");
  }

  expected<void, SetupError> write_events() {
    std::ranges::stable_sort(events_, {}, &std::pair<std::uint64_t, std::string>::first);
    if (!events_.empty()) {
      const std::string stem = (inside_ / "beh" / (head_ + run_)).string() + "_events";
      std::string text =
          "onset\tduration\ttrial_type\ttrial\tresponse\tresponse_time\tseed\tnote\n";
      for (const auto& [time_ns, line] : events_)
        text += line;
      texts_[stem + ".tsv"] = std::move(text);
      texts_[stem + ".json"] =
          Json{{"TaskName", task_name_},
               {"trial_type",
                {{"Description",
                  "The condition of a trial, marker, or note (made after the recording)"}}},
               {"trial", {{"Description", "The number of the trial, from 1"}}},
               {"response", {{"Description", "The participant's response"}}},
               {"response_time",
                {{"Description", "From the beginning of the trial to its end"}, {"Units", "s"}}},
               {"seed", {{"Description", "Of the trial's random numbers"}}},
               {"note",
                {{"Description", "The label of a marker, the text of a note, or one on a trial"}}}}
              .dump(2) +
          "\n";
      scan_lines_ += fs::path(stem + ".tsv").lexically_relative(inside_).generic_string() + "\t" +
                     time_text(begin_ns_) + "\n";
    }
    for (const auto& [name, text] : texts_) {
      std::error_code cause;
      fs::create_directories((draft_ / name).parent_path(), cause);
      std::ofstream file(draft_ / name, std::ios::binary);
      file << text << std::flush;
      if (cause || !file) return failure();
    }
    report_.topic_count = files_.size();
    return {};
  }

  /// Moves the files into the data set, after a look whether any is there already.
  expected<void, SetupError> publish() {
    std::error_code cause;
    const bool is_new = !fs::exists(folder_, cause);
    if (!is_new && !fs::exists(folder_ / "dataset_description.json", cause)) {
      return setup_error(what(), "it has no dataset_description.json, so it is no BIDS data set",
                         "choose another folder");
    }
    std::vector<fs::path> files;
    if (fs::exists(draft_, cause)) {
      for (fs::recursive_directory_iterator next(draft_, cause), end; !cause && next != end;
           next.increment(cause)) {
        if (next->is_regular_file(cause)) files.push_back(fs::relative(next->path(), draft_));
      }
    }
    for (const fs::path& file : files) {
      if (fs::exists(folder_ / file, cause)) {
        return setup_error(what(), "it has " + printable(file.string()) + " already",
                           "give another --run, --session or --participant");
      }
    }
    fs::create_directories(folder_ / inside_, cause);
    if (cause) return setup_error(what(), cause);
    for (const fs::path& file : files) {
      fs::create_directories((folder_ / file).parent_path(), cause);
      if (!cause) fs::rename(draft_ / file, folder_ / file, cause);
      if (cause) return setup_error(what(), cause);
    }
    if (is_new) {
      const Json description{{"Name", task_name_},
                             {"BIDSVersion", "1.10.0"},
                             {"DatasetType", "raw"},
                             {"GeneratedBy", Json::array({{{"Name", "rtpm bag export --bids"}}})}};
      if (auto put = append("dataset_description.json", description.dump(2) + "\n"); !put)
        return put;
      if (auto put = append("README", "Recordings of " + printable(task_name_) + " by RTPM.\n");
          !put)
        return put;
    }
    if (auto put = add_lines("participants.tsv", "participant_id\n", subject_ + "\n"); !put)
      return put;
    return add_lines(scans_, "filename\tacq_time\n", scan_lines_);
  }

  /// Adds lines to a table of the data set, unless it begins with them.
  expected<void, SetupError> add_lines(const std::string& name, const std::string& header,
                                       const std::string& lines) {
    std::ifstream file(folder_ / name);
    const std::string before{std::istreambuf_iterator<char>(file), {}};
    if (before.find("\n" + lines) != std::string::npos) return {};
    return append(name, (before.empty() ? header : "") + lines);
  }
  expected<void, SetupError> append(const std::string& name, const std::string& text) {
    std::ofstream file(folder_ / name, std::ios::app | std::ios::binary);
    file << text << std::flush;
    return file ? expected<void, SetupError>{} : failure();
  }
  [[nodiscard]] unexpected<SetupError> failure() const {
    return setup_error(what(), system_error(errno));
  }

  recording::FileReader& reader_;
  fs::path folder_;
  fs::path draft_;
  const BidsOptions& options_;
  const recording::Progress& progress_;
  Course course_;
  std::uint64_t begin_ns_;
  std::uint64_t end_ns_;
  std::string task_name_{};
  std::string subject_{};  ///< "sub-P07".
  fs::path inside_{};      ///< "sub-P07/ses-1".
  std::string head_{};     ///< "sub-P07_ses-1_task-touch".
  std::string run_{};      ///< "_run-2".
  std::string scans_{};
  std::string scan_lines_{};
  std::set<std::string> labels_{};
  std::map<std::uint16_t, SampleFile> files_{};
  std::map<std::string, std::string> texts_{};  ///< Small files, by name.
  TrialPairs trials_{};
  std::vector<std::pair<std::uint64_t, std::string>> events_{};
  std::size_t event_byte_count_ = 0;
  LeftOutCounter left_out_{};
  Report report_{};
};

}  // namespace

expected<Report, SetupError> export_bids(recording::FileReader& reader, const std::string& folder,
                                         const BidsOptions& options,
                                         const recording::Progress& progress) {
  return BidsExport(reader, folder, options, progress).run();
}

}  // namespace rtpm::exports
