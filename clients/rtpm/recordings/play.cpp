#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "devices/device_names.hpp"
#include "recordings/commands.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/replay/player.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

using program::formatted;

constexpr Duration kPlayPeriod = std::chrono::milliseconds{100};
constexpr const char* kNoHub = "none";

struct PlayRequest {
  std::string file{};
  replay::Selection selection{};
  std::string hub{events::kHubPath};
  bool is_hub_given = false;
  std::string folder{};
  std::string output{};
  double speed = 1;
  bool is_stepped = false;
  bool loops = false;
  bool holds = false;
  bool is_of_parameters = false;
};

double seconds(Duration time) {
  return std::chrono::duration<double>(time).count();
}

/// "12.3 of 60.0 s, 1200 reads, 1199 commands, 3600 events".
std::string text_of(const replay::Recorded& recorded, const replay::PlayerStatus& status) {
  std::string text = formatted("%.1f of %.1f s", seconds(status.at), seconds(recorded.length));
  if (status.round > 0) text += ", round " + std::to_string(status.round + 1);
  text += ", " + std::to_string(status.read_count) + " reads, " +
          std::to_string(status.command_count) + " commands, " +
          std::to_string(status.pushed_count) + " events";
  if (status.refused_count > 0) {
    text += ", " + std::to_string(status.refused_count) + " commands refused";
  }
  if (status.failed_count > 0) {
    text += ", " + std::to_string(status.failed_count) + " events not pushed";
  }
  return text;
}

int tell_end(const Context& context, const PlayRequest& request, const replay::Recorded& recorded,
             const replay::Player& player, const replay::PlayerStatus& status) {
  if (!context.json) {
    print_line(printable(request.file) + ": played " + text_of(recorded, status));
    return kDone;
  }
  Json devices = Json::array();
  for (const replay::Player::Served& served : player.served())
    devices.push_back({{"name", served.name}, {"url", served.url}});
  print_json({{"file", request.file},
              {"devices", std::move(devices)},
              {"length_s", seconds(recorded.length)},
              {"at_s", seconds(status.at)},
              {"round", status.round},
              {"read_count", status.read_count},
              {"command_count", status.command_count},
              {"refused_count", status.refused_count},
              {"event_count", status.pushed_count},
              {"failed_event_count", status.failed_count},
              {"notes", recorded.notes}});
  return kDone;
}

/// The hub for the events; empty if there is none. A missing hub is an error only if it was
/// requested.
expected<std::string, SetupError> hub_of(Context& context, const PlayRequest& request,
                                         const replay::Recorded& recorded) {
  if (recorded.events.empty() || request.hub == kNoHub) return std::string{};
  const auto types = events::HubTypes::ask(context.node(), request.hub);
  if (types) return request.hub;
  if (request.is_hub_given || recorded.devices.empty()) return unexpected{types.error()};
  rt::print_error("rtpm", "the events are not played: " + types.error().text());
  return std::string{};
}

replay::PlayerConfig config_of(const Context& context, const PlayRequest& request) {
  replay::PlayerConfig config{.registry = context.registry,
                              .folder = request.folder,
                              .speed = request.speed,
                              .is_stepped = request.is_stepped};
  config.end = request.loops   ? replay::End::kLoop
               : request.holds ? replay::End::kHold
                               : replay::End::kGone;
  config.server.realtime = rt::RealtimeMode::kOff;
  return config;
}

void tell_begin(const Context& context, const replay::Recorded& recorded,
                const replay::Player& player) {
  for (const std::string& note : recorded.notes)
    rt::print_error("rtpm", printable(note, kShownWhole));
  for (const std::string& type : player.unknown_types()) {
    rt::print_error("rtpm", "the hub does not know " + printable(type) +
                                ": its events are pushed, but no filter reads their fields");
  }
  if (context.json) return;
  for (const replay::Player::Served& served : player.served())
    print_line("serving " + printable(served.name) + " at " + served.url);
}

/// Why the given registry does not answer. A scope needs no registry, as the player then serves its
/// names itself.
std::optional<SetupError> missing_registry(Context& context) {
  const auto scope = discovery::parse_scope(context.registry);
  if (!scope) return scope.error();
  if (!scope->is_url()) return std::nullopt;
  const auto names = device_names(context);
  return names ? std::nullopt : std::optional(names.error());
}

int play_into(Context& context, const PlayRequest& request, const replay::Recorded& recorded,
              recording::Recorder* output) {
  if (const auto missing = missing_registry(context); !recorded.devices.empty() && missing) {
    return context.not_reached(*missing);
  }
  auto hub = hub_of(context, request, recorded);
  if (!hub) return context.not_reached(hub.error());
  replay::PlayerConfig config = config_of(context, request);
  config.hub = std::move(*hub);
  config.commands = output;
  const auto player = replay::Player::create(context.node(), recorded, std::move(config));
  if (!player) return context.fail(player.error());
  tell_begin(context, recorded, **player);
  if (const auto started = (*player)->start(); !started) return context.fail(started.error());
  {
    StatusLine line(context);
    while (!(*player)->is_over() && !context.stop().wait_for(kPlayPeriod))
      line.show(text_of(recorded, (*player)->status()));
  }
  const replay::PlayerStatus status = (*player)->status();
  (*player)->stop();
  if (output != nullptr) {
    if (const auto closed = output->close(); !closed) return context.fail(closed.error());
  }
  return tell_end(context, request, recorded, **player, status);
}

expected<replay::Recorded, SetupError> load(Context& context, const PlayRequest& request) {
  ProgressBar bar(context, "loading");
  return replay::load(request.file, request.selection,
                      [&bar](auto done, auto whole) { return bar.show(done, whole); });
}

int play(Context& context, const PlayRequest& request) {
  static_cast<void>(context.stop());
  if (request.selection.to && *request.selection.to < request.selection.from) {
    return context.fail("--to is before --from", kMisused);
  }
  if (request.is_of_parameters) {
    return restore_parameters(context, {.file = request.file,
                                        .devices = request.selection.devices,
                                        .folder = request.folder,
                                        .from = request.selection.from});
  }
  const auto recorded = load(context, request);
  if (!recorded) return context.fail(recorded.error());
  if (request.output.empty()) return play_into(context, request, *recorded, nullptr);
  auto output = recording::Recorder::create(request.output, {.writer = {.profile = "rtpm"}});
  if (!output) return context.fail(output.error());
  const int exit_code = play_into(context, request, *recorded, output->get());
  if (exit_code != kDone && (*output)->status().message_count == 0) {
    output->reset();
    static_cast<void>(std::remove(request.output.c_str()));  // The file is empty.
  }
  return exit_code;
}

void add_pace_options(CLI::App& command, PlayRequest& request) {
  CLI::Option* const speed =
      command.add_option("--speed", request.speed, "Seconds of the recording per second")
          ->check(CLI::Range(0.001, 1000.0))
          ->capture_default_str();
  command
      .add_flag("--step", request.is_stepped,
                "Each read of a device gets its next sample, whatever its timing")
      ->excludes(speed);
  CLI::Option* const loop = command.add_flag("--loop", request.loops, "Begin again at the end");
  command.add_flag("--hold", request.holds, "Keep showing the last samples at the end")
      ->excludes(loop);
}

}  // namespace

void add_play(CLI::App& program, Context& context) {
  const auto request = std::make_shared<PlayRequest>();
  CLI::App& command = add_command(
      program, context, "play", "Serve the devices of a recording again, and push its events",
      "  rtpm play run.mcap --speed 0.5\n"
      "  rtpm play run.mcap --step --devices lab/arm0 --output commands.mcap\n"
      "The devices have the names, descriptions and samples that `rtpm record` found, bit by bit,\n"
      "and refuse and accept commands as they did; but no command moves them. At the end they are\n"
      "lost, as if unplugged, for 1 s, and the program ends; with --step once each device has\n"
      "shown its last sample. Ctrl-C ends it before.\n"
      "--parameters sets the recorded parameters and calibrations at the devices of these names\n"
      "instead, which then are as in the recording; nothing is played. Of a device all are set, "
      "or\n"
      "none. Only one of the same model and serial number is changed.\n",
      [request](Context& c) { return play(c, *request); });
  command.add_option("FILE", request->file, "The recording")->required()->type_name("");
  command
      .add_option("--devices", request->selection.devices,
                  "Only these, and their events, by name; without: all")
      ->delimiter(',')
      ->type_name("NAMES");
  command.add_option("--topics", request->selection.topics, "Only events of these; without: all")
      ->delimiter(',')
      ->type_name("TOPICS");
  add_duration(command, "--from", request->selection.from, "Begin so long after the first message");
  add_duration(command, "--to", request->selection.to, "End so long after the first message");
  add_pace_options(command, *request);
  command
      .add_flag("--parameters", request->is_of_parameters,
                "Play nothing: set the recorded parameters, as at --from, at the devices")
      ->excludes("--speed", "--step", "--loop", "--hold", "--topics", "--to");
  command
      .add_option("--hub", request->hub, "The hub that gets the events, by name or URL; none: none")
      ->capture_default_str()
      ->each([request](const std::string&) { request->is_hub_given = true; });
  command.add_option("--folder", request->folder,
                     "Put before each name: 'replay' makes replay/lab/arm0 of lab/arm0");
  command
      .add_option("-o,--output", request->output,
                  "Record the commands that the devices accept, in this new file")
      ->type_name("FILE");
}

}  // namespace rtpm::tool
