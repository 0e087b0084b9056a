#include "rtpm/replay/player.hpp"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <utility>

#include "event_player.hpp"
#include "rtpm/capture/command_recorder.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::replay {
namespace {

constexpr double kSpeedMin = 0.001;
constexpr double kSpeedMax = 1000;
constexpr Duration kTick = std::chrono::milliseconds{1};

/// Hands a device's commands to the recorder.
class RecordedCommands final : public CommandSink {
 public:
  explicit RecordedCommands(std::unique_ptr<capture::CommandRecorder> recorder) noexcept
      : recorder_(std::move(recorder)) {}
  void take(const device::Command& command, std::uint64_t sample_sequence) noexcept override {
    recorder_->record(command, sample_sequence);
  }

 private:
  std::unique_ptr<capture::CommandRecorder> recorder_;
};

}  // namespace

struct Player::Impl final : gvd::EmergencyStops {
  Impl(rpc::Node& given_node, const Recorded& given, PlayerConfig wanted)
      : node(given_node),
        recorded(given),
        config(std::move(wanted)),
        pace(recorded.length, config.speed, config.end == End::kLoop) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() override { stop(); }

  expected<void, SetupError> add_devices() {
    for (const RecordedDevice& device : recorded.devices) {
      ReplayedDeviceConfig settings{.pace = config.is_stepped ? nullptr : &pace,
                                    .end = config.end,
                                    .lease_key = gvd::random_lease_key(),
                                    .emergency_stops = this};
      if (config.commands != nullptr) {
        auto recorder = capture::CommandRecorder::create(*config.commands, device.name);
        if (!recorder) return unexpected{recorder.error()};
        sinks.push_back(std::make_unique<RecordedCommands>(std::move(*recorder)));
        settings.commands = sinks.back().get();
      }
      devices.push_back(std::make_unique<ReplayedDevice>(device, settings));
    }
    return {};
  }

  expected<void, SetupError> serve() {
    if (devices.empty()) return {};
    auto created = rpc::Server::create(config.server);
    if (!created) return unexpected{created.error()};
    server = std::move(*created);
    for (const auto& device : devices) {
      const std::string name = played_name(config.folder, device->recorded().name);
      if (auto added = server->add(name, *device); !added) return added;
      catalog.add(name, *device);
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

  [[nodiscard]] Pace::Position position(MonotonicTime now) const {
    if (!config.is_stepped) return pace.position(now);
    Pace::Position farthest;
    bool is_through = !devices.empty();
    for (const auto& device : devices) {
      const std::uint64_t count = device->recorded().samples.size();
      const std::uint64_t step = device->step_count();
      is_through = is_through && step >= count;
      if (step == 0) continue;
      const bool loops = config.end == End::kLoop;
      const Pace::Position own{
          device->recorded().times[loops ? (step - 1) % count : std::min(step, count) - 1],
          loops ? (step - 1) / count : 0, false};
      const bool is_farther =
          own.round > farthest.round || (own.round == farthest.round && own.at > farthest.at);
      if (is_farther) farthest = own;
    }
    if (is_through && config.end != End::kLoop) farthest.at = recorded.length;
    farthest.is_over = is_through;
    return farthest;
  }

  void tick(MonotonicTime now) {
    for (const auto& device : devices)
      device->attend(now);
    const Pace::Position at = position(now);
    if (events && (at.at > Duration{0} || !config.is_stepped)) {
      const std::lock_guard lock(mutex);
      events->advance(at, now, config.is_stepped ? std::nullopt : std::optional(config.speed));
    }
    if (config.end != End::kGone || !at.is_over) return;
    if (!over_since) over_since = now;
    // In steps a device is lost to the reader that goes beyond its last sample.
    if (!config.is_stepped) {
      for (const auto& device : devices)
        device->lose();
    }
    const Duration farewell = devices.empty() ? Duration{0} : config.farewell;
    if (now - *over_since >= farewell) is_over.store(true, std::memory_order_release);
  }

  void run() {
    MonotonicTime due = rt::now();
    while (!is_stopping.load(std::memory_order_relaxed)) {
      tick(rt::now());
      due = std::max(due + kTick, rt::now());
      rt::sleep_until(due);
    }
  }

  void stop() noexcept {
    // Unbinds the names first, so that no client finds a server that is about to end.
    registrations.clear();
    is_stopping.store(true, std::memory_order_relaxed);
    if (thread.is_running()) thread.join();
    if (server) server->stop();
  }

  void stop_devices() noexcept override {
    for (const auto& device : devices)
      device->emergency_stop();
  }
  [[nodiscard]] bool stop_system() noexcept override {
    stop_devices();
    return false;
  }

  rpc::Node& node;
  const Recorded& recorded;
  PlayerConfig config;
  Pace pace;
  std::vector<std::unique_ptr<RecordedCommands>> sinks{};
  std::vector<std::unique_ptr<ReplayedDevice>> devices{};
  introspection::Catalog catalog{};
  std::unique_ptr<rpc::Server> server{};
  std::vector<Served> served{};
  std::vector<std::unique_ptr<names::Registration>> registrations{};
  mutable rt::PiMutex mutex{};
  std::unique_ptr<EventPlayer> events{};
  std::optional<MonotonicTime> over_since{};
  std::atomic<bool> is_over{false};
  std::atomic<bool> is_stopping{false};
  rt::Thread thread{};
};

expected<std::unique_ptr<Player>, SetupError> Player::create(rpc::Node& node,
                                                             const Recorded& recorded,
                                                             PlayerConfig config) {
  if (!(config.speed >= kSpeedMin && config.speed <= kSpeedMax)) {
    return setup_error("a recording is not played at this speed", "", "choose 0.001 to 1000");
  }
  auto impl = std::make_unique<Impl>(node, recorded, std::move(config));
  for (const auto step : {&Impl::join_hub, &Impl::add_devices, &Impl::serve}) {
    if (auto done = ((*impl).*step)(); !done) return unexpected{std::move(done.error())};
  }
  return std::unique_ptr<Player>(new Player(std::move(impl)));
}

Player::Player(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Player::~Player() = default;

expected<void, SetupError> Player::start() {
  impl_->pace.start(rt::now());
  auto thread = rt::Thread::start({.name = "rtpm-play"}, [this] { impl_->run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  impl_->thread = std::move(*thread);
  return {};
}

bool Player::is_over() const noexcept {
  return impl_->is_over.load(std::memory_order_acquire);
}

void Player::stop() noexcept {
  impl_->stop();
}

PlayerStatus Player::status() const {
  const Pace::Position at = impl_->position(rt::now());
  PlayerStatus status{.at = at.at, .round = at.round};
  for (const auto& device : impl_->devices) {
    const ReplayedDevice::Counters counters = device->counters();
    status.read_count += counters.read_count;
    status.command_count += counters.command_count;
    status.refused_count += counters.refused_count;
  }
  const std::lock_guard lock(impl_->mutex);
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
