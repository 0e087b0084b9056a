#include <unistd.h>

#include <cerrno>
#include <memory>
#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "recordings/commands.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/exports/export.hpp"

namespace rtpm::tool {
namespace {

struct ExportRequest {
  std::string file{};
  std::string output{};
  bool is_ros2 = false;
  bool is_csv = false;
  bool is_parquet = false;
  bool is_video = false;
  std::string medium{};  ///< The camera; empty: the only one.
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
int export_parquet(const Context& context, const ExportRequest& request) {
  ::execlp("python3", "python3", "-c", kParquetProgram, request.file.c_str(),
           request.output.c_str(), context.json ? "--json" : nullptr, nullptr);
  return context.fail(SetupError{.what = "Parquet files are written by python3, which can't be run",
                                 .why = system_error(errno).message(),
                                 .remedy = "install Python, then: pip install 'rtpm[parquet]'"});
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
                {"left_out", std::move(left_out)}});
  } else {
    print_line(printable(request.output) + " has " + std::to_string(done.message_count) +
               " messages in " + std::to_string(done.topic_count) +
               (request.is_csv ? " files" : " topics"));
    for (const exports::LeftOut& each : done.left_out) {
      print_line(printable(each.topic) + ": " + std::to_string(each.message_count) +
                 " messages were left out: " + printable(each.reason));
    }
  }
  return done.left_out.empty() ? kDone : kFailed;
}

int run(Context& context, const ExportRequest& request) {
  const int format_count =
      int{request.is_ros2} + int{request.is_csv} + int{request.is_parquet} + int{request.is_video};
  if (format_count != 1)
    return context.fail("one of --ros2, --csv and --parquet, or --video, is required", kMisused);
  if (request.is_parquet) return export_parquet(context, request);
  if (request.is_video) return export_video(context, request.file, request.output, request.medium);
  expected<exports::Report, SetupError> done{};
  {
    ProgressBar bar(context, "exporting");
    const auto show = [&bar](auto part, auto whole) { return bar.show(part, whole); };
    const auto reader =
        recording::FileReader::open(request.file, recording::Incomplete::kRefuse, show);
    if (!reader) {
      done = unexpected{reader.error()};
    } else if (request.is_csv) {
      done = exports::export_csv(**reader, request.output, show);
    } else {
      done = exports::export_ros2(**reader, request.output, show);
    }
  }
  return done ? report(context, request, *done) : context.fail(done.error());
}

}  // namespace

void add_export(CLI::App& group, Context& context) {
  const auto request = std::make_shared<ExportRequest>();
  CLI::App& command = add_command(
      group, context, "export", "Convert a recording for ROS 2, or to tables",
      "  rtpm bag export run.mcap run_ros2.mcap --ros2\n"
      "  rtpm bag export run.mcap tables --csv\n"
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
  command.add_flag("--csv", request->is_csv, "Write a CSV file for each channel");
  command.add_flag("--parquet", request->is_parquet,
                   "Write a Parquet file for each channel, by RTPM's Python package");
  CLI::Option* const video = command.add_flag(
      "--video", request->is_video, "Write a Matroska file of a camera's pictures and sound");
  command.add_option("--medium", request->medium, "The camera, where there are several")
      ->type_name("NAME")
      ->needs(video);
}

}  // namespace rtpm::tool
