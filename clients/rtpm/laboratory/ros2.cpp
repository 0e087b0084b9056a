#include <cstdlib>
#include <memory>
#include <string>

#include "cli/command.hpp"
#include "laboratory/commands.hpp"

namespace rtpm::tool {
namespace {

struct Ros2Request {
  int seconds = 0;
  std::string command{};
};

int ros2(Context& context, const Ros2Request& request) {
  const std::string path = laboratory::program_folders().front() + "/../share/rtpm/ros2.toml";
  return bring_up(context,
                  laboratory::read_plan(path, {{"seconds", std::to_string(request.seconds)},
                                               {"command", request.command}}));
}

}  // namespace

void add_ros2(CLI::App& program, Context& context) {
  const auto request = std::make_shared<Ros2Request>();
  CLI::App& command = add_command(
      program, context, "ros2", "Show four simulated devices as topics of ROS 2",
      "  rtpm ros2\n"
      "  rtpm ros2 --command lab/knob0\n"
      "Brings up share/rtpm/ros2.toml: a registry, a server with an arm, a gaze tracker, a\n"
      "biometric sensor and a knob, a force loop that lets the arm touch a virtual wall, and the\n"
      "bridge rtpm-ros2 in the domain that ROS_DOMAIN_ID names. Then `ros2 topic list` shows "
      "/rtpm/lab/arm0/pose and others. A message on /rtpm/stop\n"
      "stops every device.\n",
      [request](Context& c) { return ros2(c, *request); });
  command.add_option("--seconds", request->seconds, "How long; without: until Ctrl-C")
      ->check(CLI::Range(0, 99'999))
      ->type_name("N");
  command
      .add_option("--command", request->command,
                  "Devices that ROS topics may command, separated by commas")
      ->type_name("DEVICES");
}

}  // namespace rtpm::tool
