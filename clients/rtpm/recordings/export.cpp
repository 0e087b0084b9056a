#include <algorithm>
#include <chrono>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "os/system.hpp"
#include "recordings/commands.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/exports/bids.hpp"
#include "rtpm/exports/export.hpp"
#include "rtpm/recording/notes.hpp"

namespace rtpm::tool {
namespace {

struct ExportRequest {
  std::string file{};
  std::string output{};
  bool is_ros2 = false;
  bool is_csv = false;
  bool is_parquet = false;
  bool is_video = false;
  bool is_bids = false;
  std::string medium{};  ///< The camera; empty: the only one.
  exports::TableOptions tables{};
  exports::BidsOptions bids{};
  std::optional<Duration> from{};
  std::optional<Duration> to{};
  std::vector<std::string> between{};
  CLI::App* command = nullptr;  ///< Which has the options.

  /// Whether the command line has one of these options.
  [[nodiscard]] bool has(std::initializer_list<const char*> names) const {
    return std::ranges::any_of(names, [&](const char* name) { return command->count(name) > 0; });
  }
  [[nodiscard]] bool has_part() const {
    return has({"--from", "--to", "--between", "--trial", "--condition"});
  }
  [[nodiscard]] bool has_columns() const { return has({"--columns", "--joined"}); }
  [[nodiscard]] bool has_table_options() const {
    return has_columns() || has_part() || has({"--topics", "--rate"});
  }
};

/// Debian has no library that writes Parquet files; Python has one.
constexpr const char* kParquetProgram = R"(
import sys
try:
    from rtpm import parquet
except ImportError as problem:
    sys.exit(f"rtpm: Parquet files are written by RTPM's Python package: {problem}. "
             "Remedy: pip install 'rtpm[parquet]', in the environment of python3.")
sys.exit(parquet.main(sys.argv[1:]))
)";

/// Becomes Python's converter, which reports for itself.
int become_python(const Context& context, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {"-c", kParquetProgram});
  if (context.json) arguments.emplace_back("--json");
  return context.fail(os::become_python(std::move(arguments)));
}

int report(const Context& context, const ExportRequest& request, const exports::Report& done) {
  if (context.json) {
    Json left_out = Json::array();
    for (const exports::LeftOut& each : done.left_out) {
      left_out.push_back(
          {{"topic", each.topic}, {"reason", each.reason}, {"message_count", each.message_count}});
    }
    print_json({{"output", request.output},
                {"message_count", done.message_count},
                {"topic_count", done.topic_count},
                {"row_count", done.row_count},
                {"late_count", done.late_count},
                {"left_out", std::move(left_out)}});
  } else {
    print_line(printable(request.output) + " has " + std::to_string(done.message_count) +
               " messages in " + std::to_string(done.topic_count) +
               (request.is_bids                               ? " devices"
                : request.is_csv && !request.tables.is_joined ? " files"
                                                              : " topics") +
               (done.row_count == 0 ? ""
                : request.is_bids
                    ? ", and " + std::to_string(done.row_count) + " trials, marks and notes"
                    : ", as " + std::to_string(done.row_count) + " rows"));
    if (done.late_count > 0) {
      print_line(std::to_string(done.late_count) +
                 " values came more than 1 s after later ones; they are in the rows of when they "
                 "came");
    }
    for (const exports::LeftOut& each : done.left_out) {
      print_line(printable(each.topic) + ": " + std::to_string(each.message_count) +
                 " messages were left out: " + printable(each.reason));
    }
  }
  return done.left_out.empty() ? kDone : kFailed;
}

expected<exports::Report, SetupError> convert(Context& context, const ExportRequest& request,
                                              const std::string& output) {
  ProgressBar bar(context, "exporting");
  const auto show = [&bar](auto part, auto whole) { return bar.show(part, whole); };
  const auto reader =
      recording::FileReader::open(request.file, recording::Incomplete::kRefuse, show);
  if (!reader) return unexpected{reader.error()};
  auto notes = recording::read_notes(request.file);
  if (!notes) return unexpected{notes.error()};
  if (request.is_ros2) {
    const exports::Ros2Options options{.part = request.tables.part, .notes = std::move(*notes)};
    return exports::export_ros2(**reader, output, options, show);
  }
  if (request.is_bids) {
    exports::BidsOptions options = request.bids;
    options.notes = std::move(*notes);
    options.topics = request.tables.topics;
    options.rate_hz = request.tables.rate_hz;
    return exports::export_bids(**reader, output, options, show);
  }
  exports::TableOptions options = request.tables;
  options.notes = std::move(*notes);
  return exports::export_csv(**reader, output, options, show);
}

/// Tables that are chosen or joined are made as CSV first, which Python converts and removes.
int export_parquet(Context& context, const ExportRequest& request) {
  if (!request.has_table_options()) return become_python(context, {request.file, request.output});
  const std::string tables = request.output + ".tables";
  if (const auto done = convert(context, request, tables); !done) return context.fail(done.error());
  return become_python(context, {tables, request.output, "--tables"});
}

/// Why the format does not take one of the options; empty if it takes all.
std::string refusal_of(const ExportRequest& request) {
  if (request.is_bids && (request.has_columns() || request.has_part())) {
    return "--bids takes --topics and --rate only; `rtpm bag cut` makes a part of a recording";
  }
  if (request.is_video && request.has_table_options()) {
    return "topics, columns, parts and rates are not for --video; `rtpm bag cut` makes a part of a "
           "recording";
  }
  if (request.is_ros2 && request.has({"--rate"})) {
    return "--rate is not for --ros2, which has each message once, as it was recorded; use "
           "`ros2 run topic_tools throttle` while it is played, or --csv with --rate";
  }
  if (request.is_ros2 && (request.has_columns() || request.has({"--topics"}))) {
    return "topics and columns are not for --ros2; `rtpm bag cut --topics` makes a recording of "
           "some topics";
  }
  return {};
}

int run(Context& context, ExportRequest& request) {
  const int format_count = int{request.is_ros2} + int{request.is_csv} + int{request.is_parquet} +
                           int{request.is_video} + int{request.is_bids};
  if (format_count != 1)
    return context.fail("one of --ros2, --csv, --parquet, --bids and --video is required",
                        kMisused);
  if (const std::string why = refusal_of(request); !why.empty()) {
    return context.fail(why, kMisused);
  }
  if (request.from)
    request.tables.part.from_s = std::chrono::duration<double>(*request.from).count();
  if (request.to) request.tables.part.to_s = std::chrono::duration<double>(*request.to).count();
  if (request.between.size() == 2)
    request.tables.part.between = {request.between[0], request.between[1]};
  if (request.is_parquet) return export_parquet(context, request);
  if (request.is_video) return export_video(context, request.file, request.output, request.medium);
  const auto done = convert(context, request, request.output);
  return done ? report(context, request, *done) : context.fail(done.error());
}

void add_table_options(CLI::App& command, ExportRequest& request) {
  exports::TableOptions& tables = request.tables;
  command
      .add_flag("--joined", tables.is_joined,
                "One of all topics on one clock, each value held until the next one")
      ->group("Tables");
  command.add_option("--topics", tables.topics, "Only topics or devices like these")
      ->type_name("PATTERN")
      ->group("Tables");
  command.add_option("--columns", tables.columns, "Only columns like these: 'position_m.*'")
      ->type_name("PATTERN")
      ->group("Tables");
  command.add_option("--rate", tables.rate_hz, "Rows per second; without: as recorded")
      ->type_name("HZ")
      ->check(CLI::Range(1e-3, 1e6))
      ->group("Tables");
}

void add_part_options(CLI::App& command, ExportRequest& request) {
  add_duration(command, "--from", request.from, "Begin so long after the first message")
      .group("Part");
  add_duration(command, "--to", request.to, "End so long after the first message").group("Part");
  command.add_option("--between", request.between, "From a mark to the next other one")
      ->type_name("LABEL LABEL")
      ->expected(2)
      ->group("Part");
  command.add_option("--trial", request.tables.part.trial, "Only the trial with this number")
      ->type_name("NUMBER")
      ->group("Part");
  command.add_option("--condition", request.tables.part.condition, "Only trials of this condition")
      ->type_name("TEXT")
      ->group("Part");
}

}  // namespace

void add_export(CLI::App& group, Context& context) {
  const auto request = std::make_shared<ExportRequest>();
  CLI::App& command = add_command(
      group, context, "export", "Convert a recording for ROS 2, or to tables",
      "  rtpm bag export run.mcap run_ros2.mcap --ros2\n"
      "  rtpm bag export run.mcap trial3_ros2.mcap --ros2 --trial 3\n"
      "  rtpm bag export run.mcap tables --csv\n"
      "  rtpm bag export run.mcap tables --csv --joined --rate 100 --columns 'position_m.*'\n"
      "  rtpm bag export run.mcap tables --csv --joined --trial 3\n"
      "  rtpm bag export run.mcap study --bids --participant P07\n"
      "  rtpm bag export run.mcap run.mkv --video\n"
      "--ros2 writes a recording that 'ros2 bag play' and viewers of ROS 2 read: a device's pose,\n"
      "twist, applied_wrench, joint_states, joy, imu/data below /rtpm/DEVICE, /diagnostics, and "
      "all\n"
      "other topics as JSON in std_msgs/String. The exit code is 1 if something was left out.\n",
      [request](Context& c) { return run(c, *request); });
  command.add_option("FILE", request->file, "The recording")->required()->type_name("");
  command.add_option("OUT", request->output, "The new file, or the folder of tables")
      ->required()
      ->type_name("");
  command.add_flag("--ros2", request->is_ros2, "Write an MCAP file of ROS 2's standard messages");
  command.add_flag("--csv", request->is_csv, "Write a CSV file for each channel, or --joined");
  command.add_flag("--parquet", request->is_parquet,
                   "Write the same as Parquet files, by RTPM's Python package");
  CLI::Option* const video = command.add_flag(
      "--video", request->is_video, "Write a Matroska file of a camera's pictures and sound");
  command.add_option("--medium", request->medium, "The camera, where there are several")
      ->type_name("NAME")
      ->needs(video);
  CLI::Option* const bids = command.add_flag(
      "--bids", request->is_bids, "Add it to a data set in the layout of BIDS, which may be new");
  const auto add_name = [&](const char* name, std::string& value, const char* help) {
    command.add_option(name, value, help)->type_name("NAME")->needs(bids)->group("BIDS");
  };
  add_name("--participant", request->bids.participant,
           "A code; without: that of the recording's session");
  add_name("--task", request->bids.task, "The task; without: the session's experiment");
  add_name("--session", request->bids.session, "The session, where a participant has several");
  command.add_option("--run", request->bids.run, "Tells recordings of one task apart")
      ->type_name("NUMBER")
      ->needs(bids)
      ->group("BIDS");
  add_table_options(command, *request);
  add_part_options(command, *request);
  request->command = &command;
}

}  // namespace rtpm::tool
