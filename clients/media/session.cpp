#include "session.hpp"

#include <utility>

#include "line.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::media {
namespace {

/// How often the models are set again, which keeps the lease; without the lease the knob loses its
/// feel.
constexpr Duration kModelsInterval = std::chrono::milliseconds{200};
/// The hold of a command to the player: ten cycles, to bridge a short delay.
constexpr Duration kHold = std::chrono::milliseconds{100};

Mode mode_of(const std::string& name) {
  for (std::uint8_t i = 0; i < kModeCount; ++i) {
    if (to_string(Mode{i}) == name) return Mode{i};
  }
  return Mode::kSpeed;
}

expected<gvd::DeviceClient, SetupError> open_device(rpc::Node& node, const std::string& name) {
  auto device = gvd::DeviceClient::open(node, name, {.hold = kHold});
  if (!device) return unexpected{device.error()};
  if (const auto acquired = device->acquire(); !acquired) {
    return setup_error(name + " can't be commanded", std::string(to_string(acquired.error())),
                       "end the client that commands it, or take the right to command from it "
                       "(rtpm take-over)");
  }
  return device;
}

}  // namespace

Session::Session(Configuration configuration, gvd::DeviceClient knob, gvd::DeviceClient player,
                 KnobChannel knob_channel, PlayerChannels channels) noexcept
    : configuration_(std::move(configuration)),
      knob_(std::move(knob)),
      player_(std::move(player)),
      knob_channel_(knob_channel),
      channels_(channels),
      control_(knob_channel, channels.rate_max()) {
  control_.enter(mode_of(configuration_.mode), 0, {});
  call_.priority = configuration_.priority;
  call_.deadline = std::chrono::milliseconds{50};
}

expected<std::unique_ptr<Session>, SetupError> Session::open(rpc::Node& node,
                                                             const Configuration& configuration) {
  auto knob = open_device(node, configuration.knob);
  if (!knob) return unexpected{knob.error()};
  const auto knob_channel = media::knob_channel(configuration.knob, knob->descriptor());
  if (!knob_channel) return unexpected{knob_channel.error()};
  auto player = open_device(node, configuration.player);
  if (!player) return unexpected{player.error()};
  const auto channels = PlayerChannels::of(configuration.player, player->descriptor());
  if (!channels) return unexpected{channels.error()};
  return std::unique_ptr<Session>(
      new Session(configuration, std::move(*knob), std::move(*player), *knob_channel, *channels));
}

expected<void, SetupError> Session::step() {
  const MonotonicTime now = rt::now();
  const Result done = run_cycle(now);
  if (done) {
    failing_since_.reset();
    return {};
  }
  if (!failing_since_) failing_since_ = now;
  const Failure& failure = done.error();
  const bool is_hopeless = failure.error == gvd::DeviceOutcome::kNotHolder;
  if (!is_hopeless && now - *failing_since_ < configuration_.patience) return {};
  return setup_error(*failure.device + " was lost", std::string(to_string(failure.error)));
}

Session::Result Session::run_cycle(MonotonicTime now) {
  const auto knob = knob_.read(call_);
  if (!knob) return unexpected{Failure{&configuration_.knob, knob.error()}};
  const auto player = player_.read(call_);
  if (!player) return unexpected{Failure{&configuration_.player, player.error()}};
  knob_sample_ = *knob;
  view_ = channels_.view(*player);
  meter_.show(view_.position_s, view_.frame_s, rt::now());

  // A press counts two edges; only the press counts, not the release.
  const std::uint16_t edges = knob_sample_.button_edges[0];
  const bool is_pushed = edges != std::exchange(edges_, edges) && (knob_sample_.buttons & 1u) != 0;
  const bool is_first = duration_s_ < 0;
  // A file loaded later has another length, and so other end stops.
  const bool is_another_file = std::exchange(duration_s_, view_.duration_s) != view_.duration_s;
  if (is_pushed && !is_first && !configuration_.has_fixed_mode) {
    enter(next(control_.mode()), now);
  } else if (is_another_file) {
    enter(control_.mode(), now);
  }
  if (const Result commanded = command(now); !commanded) return commanded;
  return keep_feel(now);
}

void Session::enter(Mode mode, MonotonicTime now) noexcept {
  control_.enter(mode, angle_rad(), view_);
  next_models_ = now;
}

Session::Result Session::command(MonotonicTime now) {
  const Request request = control_.step(angle_rad());
  const auto set = player_.set(channels_.setpoint(request.rate, request.seek_s), call_);
  if (!set) return unexpected{Failure{&configuration_.player, set.error()}};
  meter_.command(request.seek_s, now);
  return {};
}

Session::Result Session::keep_feel(MonotonicTime now) {
  if (now < next_models_) return {};
  next_models_ = now + kModelsInterval;
  const auto set = knob_.set_models(control_.models());
  if (!set) return unexpected{Failure{&configuration_.knob, set.error().error}};
  return {};
}

double Session::angle_rad() const noexcept {
  return knob_sample_.joints[knob_channel_.joint];
}

std::string Session::line() const {
  return line_text(control_.mode(), view_, angle_rad());
}

}  // namespace rtpm::media
