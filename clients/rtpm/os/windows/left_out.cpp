#include "cli/command.hpp"
#include "events/commands.hpp"
#include "host/commands.hpp"
#include "laboratory/commands.hpp"

namespace rtpm::tool {
namespace {

/// A command that is there to say why it is not.
void add_left_out(CLI::App& program, Context& context, const char* name, const char* remedy) {
  CLI::App& command = add_command(
      program, context, name, "Not there on Windows", {}, [name, remedy](Context& refusing) {
        return refusing.fail(SetupError{.what = std::string("there is no rtpm ") + name,
                                        .why = "RTPM has it on Linux only",
                                        .remedy = remedy});
      });
  command.allow_extras();
}

constexpr const char* kStart =
    "start rtpm-registryd, rtpm-deviced and the others each by itself, or run it on Linux";

}  // namespace

void add_incidents(CLI::App& program, Context& context) {
  add_left_out(program, context, "incidents",
               "run it where rtpm-console runs, or look at its page");
}
void add_top(CLI::App& program, Context& context) {
  add_left_out(program, context, "top", "run it on Linux, or see a server's lanes by rtpm info");
}
void add_up(CLI::App& program, Context& context) {
  add_left_out(program, context, "up", kStart);
}
void add_down(CLI::App& program, Context& context) {
  add_left_out(program, context, "down", kStart);
}
void add_demo(CLI::App& program, Context& context) {
  add_left_out(program, context, "demo", kStart);
}
void add_ros2(CLI::App& program, Context& context) {
  add_left_out(program, context, "ros2", kStart);
}

}  // namespace rtpm::tool
