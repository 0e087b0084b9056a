#include "rtpm/replay/player.hpp"

#include <atomic>
#include <utility>

#include "event_player.hpp"
#include "replayed_device.hpp"
#include "rtpm/gvd/holder.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/replay/playback.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::replay {
namespace {

constexpr double kSpeedMin = 0.001;
constexpr double kSpeedMax = 1000;

}  // namespace

struct Player::Impl final : gvd::EmergencyStops, Script {
  Impl(rpc::Node& given_node, const Recorded& given, PlayerConfig wanted)
      : node(given_node),
        recorded(given),
        config(std::move(wanted)),
        playback(*this, {.length = recorded.length,
                         .loops = config.end == End::kLoop,
                         .stepped_count = config.is_stepped ? recorded.devices.size() : 0}) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() override { stop(); }

  expected<void, SetupError> start_devices() {
    for (const RecordedDevice& device : recorded.devices) {
      std::unique_ptr<capture::CommandRecorder> commands;
      if (config.commands != nullptr) {
        auto recorder = capture::CommandRecorder::create(*config.commands, device.name);
        if (!recorder) return unexpected{recorder.error()};
        commands = std::move(*recorder);
      }
      devices.push_back(std::make_unique<ReplayedDevice>(device, playback.pace(), config.end,
                                                         std::move(commands)));
      if (auto started = devices.back()->start(*this); !started) return started;
    }
    return {};
  }

  expected<void, SetupError> serve() {
    if (devices.empty()) return {};
    auto created = rpc::Server::create(config.server);
    if (!created) return unexpected{created.error()};
    server = std::move(*created);
    for (const auto& device : devices) {
      const std::string name = played_name(config.folder, device->name());
      rpc::Servant& servant = device->server().servant();
      if (auto added = server->add(name, servant); !added) return added;
      catalog.add(name, servant);
      rpc::Servant& holder = device->server().holder_servant();
      if (auto added = server->add(gvd::holder_path(name), holder); !added) return added;
      catalog.add(gvd::holder_path(name), holder);
      served.push_back({name, server->url(name)});
    }
    if (auto added = server->add(introspection::kPath, catalog); !added) return added;
    if (auto started = server->start(); !started) return started;
    return bind_names();
  }

  expected<void, SetupError> bind_names() {
    if (config.registry.empty()) return {};
    for (const Served& one : served) {
      auto bound = names::Registration::create(node, config.registry, one.name, one.url,
                                               std::string(device::DeviceClient::interface().name));
      if (!bound) return unexpected{bound.error()};
      registrations.push_back(std::move(*bound));
    }
    return {};
  }

  expected<void, SetupError> join_hub() {
    if (config.hub.empty() || recorded.events.empty()) return {};
    auto player = EventPlayer::create(node, config.hub, recorded, config.folder);
    if (!player) return unexpected{player.error()};
    events = std::move(*player);
    return {};
  }

  expected<void, SetupError> play(Duration from, const Turn& turn) override {
    if (events) events->play(from, turn);
    if (turn.is_present()) has_pushed = true;
    return {};
  }

  void stop() noexcept {
    // Unbinds the names first, so that no client finds a server that is about to end.
    registrations.clear();
    playback.stop();
    if (server) server->stop();
  }

  void stop_devices() noexcept override {
    for (const auto& device : devices)
      device->server().emergency_stop();
  }
  [[nodiscard]] bool stop_system() noexcept override {
    stop_devices();
    return false;
  }

  rpc::Node& node;
  const Recorded& recorded;
  PlayerConfig config;
  std::unique_ptr<EventPlayer> events{};
  std::atomic<bool> has_pushed{false};  ///< All events of a round were pushed.
  Playback playback;
  std::vector<std::unique_ptr<ReplayedDevice>> devices{};
  introspection::Catalog catalog{};
  std::unique_ptr<rpc::Server> server{};
  std::vector<Served> served{};
  std::vector<std::unique_ptr<names::Registration>> registrations{};
};

expected<std::unique_ptr<Player>, SetupError> Player::create(rpc::Node& node,
                                                             const Recorded& recorded,
                                                             PlayerConfig config) {
  if (!(config.speed >= kSpeedMin && config.speed <= kSpeedMax)) {
    return setup_error("a recording is not played at this speed", "", "choose 0.001 to 1000");
  }
  auto impl = std::make_unique<Impl>(node, recorded, std::move(config));
  for (const auto step : {&Impl::join_hub, &Impl::start_devices, &Impl::serve}) {
    if (auto done = ((*impl).*step)(); !done) return unexpected{std::move(done.error())};
  }
  return std::unique_ptr<Player>(new Player(std::move(impl)));
}

Player::Player(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Player::~Player() = default;

expected<void, SetupError> Player::start() {
  if (auto started = impl_->playback.start(); !started) return started;
  impl_->playback.play(impl_->config.speed);
  return {};
}

bool Player::is_over() const noexcept {
  if (impl_->config.end != End::kGone || !impl_->has_pushed) return false;
  const Duration farewell = impl_->devices.empty() ? Duration{0} : impl_->config.farewell;
  return impl_->playback.pace().is_over(rt::now() - farewell);
}

void Player::stop() noexcept {
  impl_->stop();
}

PlayerStatus Player::status() const {
  const Pace::Position position = impl_->playback.pace().position(rt::now());
  PlayerStatus status{.at = position.at, .round = position.round};
  for (const auto& device : impl_->devices) {
    const ReplayedDevice::Counters counters = device->counters();
    status.read_count += counters.read_count;
    status.command_count += counters.command_count;
    status.refused_count += counters.refused_count;
  }
  if (impl_->events) {
    status.pushed_count = impl_->events->pushed_count();
    status.failed_count = impl_->events->failed_count();
  }
  return status;
}

const std::vector<Player::Served>& Player::served() const noexcept {
  return impl_->served;
}

std::vector<std::string> Player::unknown_types() const {
  return impl_->events ? impl_->events->unknown_types() : std::vector<std::string>{};
}

}  // namespace rtpm::replay
