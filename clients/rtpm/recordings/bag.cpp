#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "cli/table.hpp"
#include "devices/parameters.hpp"
#include "recordings/commands.hpp"
#include "rtpm/base/civil_time.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/cut.hpp"
#include "rtpm/capture/parameters.hpp"
#include "rtpm/capture/session.hpp"
#include "rtpm/configuration/value_text.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/notes.hpp"
#include "rtpm/recording/repair.hpp"

namespace rtpm::tool {
namespace {

using program::formatted;
using recording::FileReader;

struct BagRequest {
  std::string file{};
  std::string output{};
  Duration from{};  ///< Time after the first message.
  std::optional<Duration> to{};
  std::vector<std::string> topics{};
  bool shows_parameters = false;
};

double seconds_of(std::uint64_t ns) {
  return static_cast<double>(ns) * 1e-9;
}

/// A UTC time in the format of RFC 3339: "2026-11-24T08:15:30.250Z".
std::string time_text(std::uint64_t ns) {
  const std::tm utc = civil_utc(ns);
  return formatted("%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", utc.tm_year + 1900, utc.tm_mon + 1,
                   utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec,
                   static_cast<int>(ns / 1'000'000 % 1000));
}

struct ChannelFacts {
  std::string topic;
  std::string type;  ///< The name of its schema; empty if it has none.
  std::string encoding;
  std::uint64_t count = 0;
  double rate_hz = 0;  ///< 0 if the recording has no length.
};

std::vector<ChannelFacts> facts_of(FileReader& reader) {
  const recording::Statistics& statistics = reader.statistics();
  const double length_s = seconds_of(statistics.end_ns - statistics.begin_ns);
  std::vector<ChannelFacts> list;
  for (const auto& [number, channel] : reader.channels()) {
    const auto schema = reader.schemas().find(channel.schema_id);
    const auto counted = statistics.message_counts.find(number);
    ChannelFacts facts{.topic = channel.topic,
                       .type = schema == reader.schemas().end() ? "" : schema->second.name,
                       .encoding = channel.message_encoding,
                       .count = counted == statistics.message_counts.end() ? 0 : counted->second};
    if (length_s > 0) facts.rate_hz = static_cast<double>(facts.count) / length_s;
    list.push_back(std::move(facts));
  }
  std::ranges::sort(list, {}, &ChannelFacts::topic);
  return list;
}

/// The content of `rtpm bag info`.
struct Info {
  std::vector<recording::Metadata> metadata{};
  std::vector<capture::RecordedParameters> parameters{};
  std::string parameters_problem{};  ///< Why they can't be read; empty if they can.
  std::vector<recording::Note> notes{};
  std::string notes_problem{};
};

Json parameters_json(const capture::RecordedParameters& recorded, bool is_whole) {
  Json json{{"device", recorded.device},
            {"model", recorded.first.model},
            {"serial", recorded.first.serial},
            {"count", recorded.first.parameters.size()},
            {"change_count", recorded.changes.size() + recorded.omitted_count}};
  if (!is_whole) return json;
  json["configuration"] = json_of(recorded.first);
  Json changes = Json::array();
  for (const capture::ParameterChange& change : recorded.changes) {
    changes.push_back({{"time_ns", change.time_ns},
                       {"revision", change.revision},
                       {"values", json_of(change.settings)}});
  }
  json["changes"] = std::move(changes);
  json["omitted_change_count"] = recorded.omitted_count;
  return json;
}

Json info_json(FileReader& reader, const BagRequest& request, const Info& info) {
  const recording::Statistics& statistics = reader.statistics();
  Json channels = Json::array();
  for (const ChannelFacts& facts : facts_of(reader)) {
    channels.push_back({{"topic", facts.topic},
                        {"type", facts.type},
                        {"encoding", facts.encoding},
                        {"message_count", facts.count},
                        {"rate_hz", facts.rate_hz}});
  }
  Json more = Json::array();
  for (const recording::Metadata& one : info.metadata)
    more.push_back({{"name", one.name}, {"values", one.values}});
  Json parameters = Json::array();
  for (const capture::RecordedParameters& one : info.parameters)
    parameters.push_back(parameters_json(one, request.shows_parameters));
  Json notes = Json::array();
  for (const recording::Note& note : info.notes)
    notes.push_back({{"time_ns", note.time_ns}, {"text", note.text}, {"made_ns", note.made_ns}});
  Json json{{"file", request.file},
            {"byte_count", std::filesystem::file_size(request.file)},
            {"is_complete", reader.is_complete()},
            {"begin_ns", statistics.begin_ns},
            {"end_ns", statistics.end_ns},
            {"message_count", statistics.message_count},
            {"chunk_count", statistics.chunk_count},
            {"session", nullptr},
            {"channels", std::move(channels)},
            {"parameters", std::move(parameters)},
            {"notes", std::move(notes)},
            {"metadata", std::move(more)}};
  if (const auto session = capture::session_of(info.metadata)) {
    json["session"] = {{"participant", session->participant},
                       {"experiment", session->experiment},
                       {"condition", session->condition},
                       {"notes", session->notes}};
  }
  if (!info.parameters_problem.empty()) json["parameters_problem"] = info.parameters_problem;
  if (!info.notes_problem.empty()) json["notes_problem"] = info.notes_problem;
  return json;
}

std::string text_of(const capture::Session& session) {
  std::vector<Row> rows;
  const auto add = [&rows](const char* name, const std::string& text) {
    if (!text.empty()) rows.push_back({name, printable(text, kShownWhole)});
  };
  add("participant", session.participant);
  add("experiment", session.experiment);
  add("condition", session.condition);
  add("notes", session.notes);
  return rows.empty() ? "" : aligned(rows, 2) + "\n";
}

/// Tables of all parameters at the beginning, and their changes.
std::string whole_text_of(const capture::RecordedParameters& recorded) {
  std::string text = "\n" + printable(recorded.device) + " (" + printable(recorded.first.model) +
                     ", serial " + printable(recorded.first.serial) + ")\n" +
                     table_of(recorded.first);
  for (const capture::ParameterChange& change : recorded.changes) {
    text += time_text(change.time_ns) + "\n";
    const std::string lines = lines_of(change.settings);
    for (std::size_t begin = 0; begin < lines.size();) {
      const std::size_t end = lines.find('\n', begin);
      text += "  " + lines.substr(begin, end - begin) + "\n";
      begin = end + 1;
    }
  }
  if (recorded.omitted_count > 0) {
    text += "and " + std::to_string(recorded.omitted_count) + " more changes\n";
  }
  return text;
}

std::string text_of(const Info& info, bool is_whole) {
  if (!info.parameters_problem.empty()) return "\n" + info.parameters_problem + "\n";
  if (info.parameters.empty()) return "";
  std::string text;
  if (is_whole) {
    for (const capture::RecordedParameters& one : info.parameters)
      text += whole_text_of(one);
    return text;
  }
  std::vector<Row> rows{{"DEVICE", "MODEL", "SERIAL", "PARAMETERS", "CHANGES"}};
  for (const capture::RecordedParameters& one : info.parameters) {
    rows.push_back({printable(one.device), printable(one.first.model), printable(one.first.serial),
                    std::to_string(one.first.parameters.size()),
                    std::to_string(one.changes.size() + one.omitted_count)});
  }
  return "\n" + aligned(rows, 3);
}

/// The notes that were made in a review, by the seconds from the recording's begin.
std::string notes_text_of(const Info& info, std::uint64_t begin_ns) {
  if (!info.notes_problem.empty()) return "\n" + info.notes_problem + "\n";
  if (info.notes.empty()) return "";
  std::vector<Row> rows{{"NOTE AT", "TEXT"}};
  for (const recording::Note& note : info.notes) {
    const auto after_ns = static_cast<std::int64_t>(note.time_ns - begin_ns);
    rows.push_back({formatted("%.3f s", static_cast<double>(after_ns) * 1e-9),
                    printable(note.text, kShownWhole)});
  }
  return "\n" + aligned(rows, 3);
}

std::string text_of(FileReader& reader, const BagRequest& request, const Info& info) {
  const recording::Statistics& statistics = reader.statistics();
  const auto session = capture::session_of(info.metadata);
  std::string text = session ? text_of(*session) : "";
  text +=
      formatted("%llu messages in %u chunks, %.1f MB",
                static_cast<unsigned long long>(statistics.message_count), statistics.chunk_count,
                static_cast<double>(std::filesystem::file_size(request.file)) * 1e-6);
  if (statistics.message_count > 0) {
    text += formatted(", %.3f s from ", seconds_of(statistics.end_ns - statistics.begin_ns)) +
            time_text(statistics.begin_ns);
  }
  text += "\n\n";
  std::vector<Row> rows{{"TOPIC", "TYPE", "ENCODING", "MESSAGES", "PER-S"}};
  for (const ChannelFacts& facts : facts_of(reader)) {
    rows.push_back({printable(facts.topic), facts.type.empty() ? "-" : printable(facts.type),
                    printable(facts.encoding), std::to_string(facts.count),
                    facts.rate_hz > 0 ? formatted("%.1f", facts.rate_hz) : "-"});
  }
  text += aligned(rows, 3);
  text += text_of(info, request.shows_parameters);
  text += notes_text_of(info, statistics.begin_ns);
  for (const recording::Metadata& one : info.metadata) {
    if (one.name == capture::kSessionMetadata) continue;
    text += "\n" + printable(one.name) + "\n";
    for (const auto& [name, value] : one.values)
      text += "  " + printable(name) + " = " + printable(value) + "\n";
  }
  return text;
}

/// Opens the file with a progress bar, because a file without a summary is read completely.
expected<std::unique_ptr<FileReader>, SetupError> open(Context& context, const BagRequest& request,
                                                       recording::Incomplete incomplete) {
  ProgressBar bar(context, "reading");
  return FileReader::open(request.file, incomplete,
                          [&bar](auto done, auto whole) { return bar.show(done, whole); });
}

int info(Context& context, const BagRequest& request) {
  const auto reader = open(context, request, recording::Incomplete::kRead);
  if (!reader) return context.fail(reader.error());
  auto metadata = (*reader)->read_metadata();
  if (!metadata) return context.fail(metadata.error());
  Info info{.metadata = std::move(*metadata)};
  if (auto parameters = capture::read_parameters(**reader)) {
    info.parameters = std::move(*parameters);
  } else {
    info.parameters_problem = parameters.error().text();
  }
  if (auto notes = recording::read_notes(request.file)) {
    info.notes = std::move(*notes);
  } else {
    info.notes_problem = notes.error().text();
  }
  if (context.json) {
    print_json(info_json(**reader, request, info));
  } else {
    std::fputs(text_of(**reader, request, info).c_str(), stdout);
    if (!(*reader)->is_complete()) {
      std::printf("\nIt was not ended: `rtpm bag recover %s -o FILE` saves what is whole.\n",
                  printable(request.file).c_str());
    }
  }
  return kDone;
}

/// The losses listed in a recovered recording; empty if there are none.
std::string recovered_text(const std::string& file) {
  const auto reader = FileReader::open(file);
  const auto metadata = reader ? (*reader)->read_metadata() : std::vector<recording::Metadata>{};
  if (!metadata) return "";
  const auto found =
      std::ranges::find(*metadata, recording::kRecoveryMetadata, &recording::Metadata::name);
  if (found == metadata->end()) return "";
  return "; it was recovered from a damaged one, see `rtpm bag info` for what that had lost";
}

int check(Context& context, const BagRequest& request) {
  expected<std::vector<std::string>, SetupError> problems{};
  {
    ProgressBar bar(context, "checking");
    problems = recording::check(request.file,
                                [&bar](auto done, auto whole) { return bar.show(done, whole); });
  }
  if (!problems) return context.fail(problems.error());
  if (context.json) {
    print_json({{"file", request.file}, {"problems", *problems}});
  } else if (problems->empty()) {
    print_line(printable(request.file) + " is whole" + recovered_text(request.file));
  } else {
    for (const std::string& problem : *problems)
      print_line(printable(request.file) + ": " + printable(problem));
  }
  return problems->empty() ? kDone : kFailed;
}

/// Lines of "lab/arm0/sampled: 1000 messages lost".
std::string losses_of(const recording::Recovery& recovery) {
  std::string text;
  for (const auto& [topic, count] : recovery.lost_counts)
    text += printable(topic) + ": " + std::to_string(count) + " messages were lost\n";
  for (const std::string& topic : recovery.untyped_topics)
    text += printable(topic) + ": its schema was lost, so it can't be played\n";
  if (recovery.unknown_channel_count > 0) {
    text += std::to_string(recovery.unknown_channel_count) +
            " messages were lost, as the record of their channel was\n";
  }
  return text;
}

int recover(Context& context, const BagRequest& request) {
  expected<recording::Recovery, SetupError> recovery{};
  {
    ProgressBar bar(context, "recovering");
    recovery = recording::recover(request.file, request.output,
                                  [&bar](auto done, auto whole) { return bar.show(done, whole); });
  }
  if (!recovery) return context.fail(recovery.error());
  if (context.json) {
    print_json({{"file", request.output},
                {"message_count", recovery->message_count},
                {"damaged_chunk_count", recovery->damaged_chunk_count},
                {"cut_byte_count", recovery->cut_byte_count},
                {"lost_counts", recovery->lost_counts},
                {"unknown_channel_count", recovery->unknown_channel_count},
                {"untyped_topics", recovery->untyped_topics}});
  } else {
    print_line(printable(request.output) + " has " + std::to_string(recovery->message_count) +
               " messages; " + std::to_string(recovery->damaged_chunk_count) +
               " damaged chunks and " + std::to_string(recovery->cut_byte_count) +
               " bytes at the end or between records were lost");
    std::fputs(losses_of(*recovery).c_str(), stdout);
  }
  return kDone;
}

/// The ids of the selected channels; the error names the topic without a channel.
expected<std::vector<std::uint16_t>, SetupError> channels_of(FileReader& reader,
                                                             const BagRequest& request) {
  std::vector<std::uint16_t> numbers;
  std::vector<std::string> topics;
  for (const auto& [number, channel] : reader.channels())
    topics.push_back(channel.topic);
  for (const std::string& topic : request.topics) {
    if (std::ranges::find(topics, topic) == topics.end()) {
      return setup_error(request.file + " has no topic '" + topic + "'" +
                         program::suggestion(topic, topics) + "; 'rtpm bag info' shows all");
    }
  }
  for (const auto& [number, channel] : reader.channels()) {
    if (std::ranges::count(request.topics, channel.topic) > 0) numbers.push_back(number);
  }
  return numbers;
}

/// `begin_ns` plus `time`, saturating at the largest value.
std::uint64_t later(std::uint64_t begin_ns, Duration time) {
  const auto ns = static_cast<std::uint64_t>(std::max(time, Duration{0}).count());
  return begin_ns > UINT64_MAX - ns ? UINT64_MAX : begin_ns + ns;
}

expected<recording::Query, SetupError> query_of(Context& context, const BagRequest& request) {
  const auto reader = open(context, request, recording::Incomplete::kRefuse);
  if (!reader) return unexpected{reader.error()};
  auto channels = channels_of(**reader, request);
  if (!channels) return unexpected{channels.error()};
  const std::uint64_t begin_ns = (*reader)->statistics().begin_ns;
  recording::Query query{.from_ns = later(begin_ns, request.from),
                         .channel_ids = std::move(*channels)};
  if (request.to) query.to_ns = later(begin_ns, *request.to);
  return query;
}

int cut(Context& context, const BagRequest& request) {
  if (request.to && *request.to < request.from) {
    return context.fail("--to is before --from", kMisused);
  }
  const auto query = query_of(context, request);
  if (!query) return context.fail(query.error());
  expected<std::uint64_t, SetupError> count{};
  {
    ProgressBar bar(context, "cutting");
    count = capture::cut(request.file, request.output, *query,
                         [&bar](auto done, auto whole) { return bar.show(done, whole); });
  }
  if (!count) return context.fail(count.error());
  if (context.json) {
    print_json({{"file", request.output}, {"message_count", *count}});
  } else {
    print_line(printable(request.output) + " has " + std::to_string(*count) + " messages");
  }
  return kDone;
}

class Actions {
 public:
  Actions(CLI::App& group, Context& context) : group_(group), context_(context) {}

  CLI::App& add(const char* name, const char* summary, const char* details,
                int (*action)(Context&, const BagRequest&)) {
    CLI::App& command =
        add_command(group_, context_, name, summary, details,
                    [request = request_, action](Context& c) { return action(c, *request); });
    command.add_option("FILE", request_->file, "The recording")->required()->type_name("");
    return command;
  }
  void add_output(CLI::App& command) {
    command.add_option("-o,--output", request_->output, "The new recording")
        ->required()
        ->type_name("FILE");
  }
  void add_parameters(CLI::App& command) {
    command.add_flag("--parameters", request_->shows_parameters,
                     "All parameters and calibrations of the devices, and each change");
  }
  void add_selection(CLI::App& command) {
    add_duration(command, "--from", request_->from, "Begin so long after the first message");
    add_duration(command, "--to", request_->to, "End so long after the first message");
    command.add_option("--topics", request_->topics, "Only these; without: all");
  }

 private:
  CLI::App& group_;
  Context& context_;
  std::shared_ptr<BagRequest> request_ = std::make_shared<BagRequest>();
};

}  // namespace

void add_bag(CLI::App& program, Context& context) {
  CLI::App& group = add_command_group(program, "bag", "Look at recordings, repair and cut them");
  Actions actions(group, context);
  actions.add_parameters(
      actions.add("info", "Show the session, topics, parameters and notes of a recording",
                  "  rtpm bag info run.mcap\n"
                  "  rtpm bag info run.mcap --parameters\n",
                  &info));
  actions.add("check", "Read all of a recording, and say what is wrong with it",
              "The exit code is 1 if something is wrong.\n", &check);
  actions.add_output(actions.add("recover",
                                 "Save what is whole in a truncated or damaged recording",
                                 "  rtpm bag recover run.mcap -o saved.mcap\n", &recover));
  CLI::App& cutting =
      actions.add("cut", "Copy a time or some topics of a recording",
                  "  rtpm bag cut run.mcap --from 10s --to 20s -o part.mcap\n"
                  "Schemas, metadata, attachments and notes come along, and at the\n"
                  "begin of the part the descriptions, parameters and states of\n"
                  "devices and the trials that held then: `rtpm play` plays it.\n",
                  &cut);
  actions.add_output(cutting);
  actions.add_selection(cutting);
  add_export(group, context);
}

}  // namespace rtpm::tool
