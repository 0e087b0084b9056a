// rtpm-servo: the force node of the paper's §3.1. It renders a virtual wall, a ball or ridges on a
// haptic device, on any host, and measures every cycle.
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "configuration.hpp"
#include "loop.hpp"
#include "report.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/program/terminal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/memory.hpp"
#include "served_wall.hpp"
#include "touch_event.hpp"

namespace rtpm::servo {
namespace {

constexpr int kSetUpFailed = 1;
constexpr int kDeviceLost = 3;
constexpr std::size_t kTerminalWidth = 80;  ///< Used if the terminal does not report it.

int fail(int exit_code, std::string_view text) {
  rt::print_error("rtpm-servo", text);
  return exit_code;
}

/// How often a local wall is set again. This keeps the lease, which its force needs.
constexpr Duration kModelsInterval = std::chrono::milliseconds{200};

/// Keeps the wall in the device's loop while this program runs.
/// @threads  change(): any; the rest: one
class LocalWall {
 public:
  LocalWall(gvd::DeviceClient& device, const Wall& wall, Duration patience)
      : device_(device), model_(wall.as_plane()), patience_(patience) {}

  /// Makes the next keep() set another wall.
  void change(const Wall& wall) {
    const std::lock_guard lock(mutex_);
    model_ = wall.as_plane();
    has_changed_ = true;
  }
  /// @errors   described in words, like those of DeviceClient::set_models()
  [[nodiscard]] expected<void, gvd::ModelsError> set(MonotonicTime now) {
    next_ = now + kModelsInterval;
    const gvd::Model model = [this] {
      const std::lock_guard lock(mutex_);
      has_changed_ = false;
      return model_;
    }();
    return device_.set_models({&model, 1});
  }
  /// Sets the wall again when due. Returns an error that has lasted for the whole patience, or that
  /// a retry can't fix.
  [[nodiscard]] std::optional<gvd::DeviceError> keep(MonotonicTime now) {
    {
      const std::lock_guard lock(mutex_);
      if (now < next_ && !has_changed_) return std::nullopt;
    }
    const auto kept = set(now);
    if (kept) {
      failing_since_.reset();
      return std::nullopt;
    }
    if (!failing_since_) failing_since_ = now;
    const gvd::DeviceError error = kept.error().error;
    const bool is_over =
        error == gvd::DeviceOutcome::kNotHolder || now - *failing_since_ >= patience_;
    return is_over ? std::optional(error) : std::nullopt;
  }

 private:
  gvd::DeviceClient& device_;
  std::mutex mutex_{};
  gvd::Model model_;          ///< Guarded by `mutex_`.
  bool has_changed_ = false;  ///< Guarded by `mutex_`.
  Duration patience_;
  MonotonicTime next_{};
  std::optional<MonotonicTime> failing_since_{};
};

/// The data of the thread next to the loop.
struct Attended {
  LocalWall* wall = nullptr;  ///< May be null.
  std::optional<scene::TouchSupplier> touches{};
};

/// Often enough for a display's 60 frames per second.
constexpr Duration kPublishInterval = std::chrono::milliseconds{4};
constexpr Duration kAttendInterval = std::chrono::milliseconds{20};

/// Sends the loop's unread touches; the loop itself never waits for a hub.
void publish(Loop& loop, scene::TouchSupplier& touches) {
  while (const auto touch = loop.next_touch())
    touches.add(*touch);
  touches.flush();
}

/// Displays the loop until it ends, or ends it on a stop request. Nothing else may print while the
/// loop runs; this thread is time-shared.
/// @errors   of the local wall, if any
std::optional<gvd::DeviceError> watch(Loop& loop, Attended& attended,
                                      const program::StopSignal& stop, const std::string& live) {
  std::optional<gvd::DeviceError> loss;
  const bool is_rewriting = live == "rewrite";
  const Duration pause =
      is_rewriting ? Duration{std::chrono::milliseconds{100}} : Duration{std::chrono::seconds{1}};
  const auto cycles = std::make_unique<LatencyHistogram>();
  const MonotonicTime begin = rt::now();
  MonotonicTime next = begin + pause;
  while (loop.is_running()) {
    if (stop.wait_for(attended.touches ? kPublishInterval : kAttendInterval)) loop.stop();
    if (attended.touches) publish(loop, *attended.touches);
    while (const auto cycle = loop.next_cycle())
      cycles->record(*cycle);
    const MonotonicTime now = rt::now();
    if (attended.wall != nullptr && !loss) loss = attended.wall->keep(now);
    if (loss) loop.stop();
    const auto view = loop.live();
    if (live == "off" || now < next || !view) continue;
    next = now + pause;
    std::string text = live_text(*view, *cycles, now - begin);
    // A line that wraps can't be rewritten.
    if (is_rewriting)
      text.resize(std::min(text.size(), program::terminal_width(kTerminalWidth) - 1));
    std::printf(is_rewriting ? "\r\033[K%s" : "%s\n", text.c_str());
    std::fflush(stdout);
  }
  if (is_rewriting) std::printf("\n");
  return loss;
}

/// How long a change of the wall waits for the loop.
constexpr Duration kChangePatience = std::chrono::milliseconds{100};

/// Replaces the wall between two cycles.
/// @return false if the loop did not accept it in time
bool change_wall(Loop& loop, LocalWall& local_wall, const Wall& wall) {
  const std::uint64_t count = loop.change_count();
  if (!loop.change(wall.material())) return false;
  local_wall.change(wall);
  const MonotonicTime end = rt::now() + kChangePatience;
  while (loop.change_count() == count && rt::now() < end)
    rt::sleep_until(rt::now() + std::chrono::milliseconds{1});
  return loop.change_count() != count;
}

expected<gvd::DeviceClient, SetupError> open_device(rpc::Node& node,
                                                    const Configuration& configuration) {
  gvd::DeviceClientOptions options;
  options.bind.warm_up = {configuration.priority};
  options.hold = configuration.hold;
  auto device = gvd::DeviceClient::open(node, configuration.device, options);
  if (!device) return unexpected{device.error()};
  if (auto acquired = device->acquire(); !acquired) {
    if (acquired.error() != gvd::DeviceOutcome::kHeld) {
      return setup_error(configuration.device + " can't be commanded",
                         std::string(to_string(acquired.error())));
    }
    return setup_error(configuration.device + " is commanded by another client", "",
                       "end that client, take the right to command from it (rtpm take-over), or "
                       "choose another --device");
  }
  if (configuration.is_recovery) {
    if (auto recovered = device->recover(); !recovered) {
      return setup_error(configuration.device + " does not recover",
                         std::string(to_string(recovered.error())));
    }
  }
  return device;
}

/// Whether the device accepts commands: active, and without a fault that blocks its force.
expected<void, SetupError> check_device(gvd::DeviceClient& device,
                                        const Configuration& configuration) {
  const auto sample = device.read();
  if (!sample) {
    return setup_error(configuration.device + " can't be read",
                       std::string(to_string(sample.error())));
  }
  if (sample->lifecycle != driver::Lifecycle::kActive) {
    return setup_error(configuration.device + " is " +
                           std::string(driver::to_string(sample->lifecycle)) + ", not active",
                       "", "read the messages of its rtpm-deviced");
  }
  if (sample->faults.has(driver::Fault::kCommandNotFinite) && !configuration.is_recovery) {
    return setup_error(configuration.device + " holds its force back", "a command was not finite",
                       "give --recover");
  }
  return {};
}

/// Explains why the loop gave up `device`.
std::string loss_text(gvd::DeviceClient& device, gvd::DeviceError loss) {
  std::string text = "was lost: " + std::string(to_string(loss));
  if (loss != gvd::DeviceOutcome::kNotHolder) return text;
  if (const auto state = device.lease_state()) text += "; " + std::string(to_string(*state));
  return text;
}

/// Serves the wall's parameters, if configured.
expected<std::unique_ptr<ServedWall>, SetupError> serve_wall(rpc::Node& node,
                                                             const Configuration& configuration,
                                                             const gvd::DeviceClient& device,
                                                             const Wall& wall, Loop& loop,
                                                             LocalWall& local_wall) {
  if (!configuration.is_serving()) return std::unique_ptr<ServedWall>{};
  return ServedWall::create(
      node, configuration, device.descriptor(), wall,
      [&](const Wall& changed) { return change_wall(loop, local_wall, changed); });
}

LoopConfig loop_config(const Configuration& configuration, const Wall& wall) {
  LoopConfig config;
  config.wall = wall;
  config.is_local = configuration.is_local();
  config.delay = configuration.delay;
  config.period = configuration.period();
  config.duration =
      std::chrono::duration_cast<Duration>(std::chrono::duration<double>(configuration.seconds));
  config.cycle_count_max = configuration.cycle_count_max;
  config.deadline = configuration.deadline;
  config.patience = configuration.patience;
  config.thread.priority = configuration.priority;
  config.thread.realtime = configuration.realtime;
  return config;
}

int serve(const Configuration& configuration) {
  const program::StopSignal stop(program::LostOutput::kRequestsEnd);
  if (auto locked = rt::lock_memory(configuration.realtime); !locked) {
    return fail(kSetUpFailed, locked.error().text());
  }
  rpc::Node node({.wait = configuration.wait, .security = configuration.security});
  names::RegistryResolver resolver(node, configuration.registry);
  node.use(resolver);
  auto device = open_device(node, configuration);
  if (!device) return fail(kSetUpFailed, device.error().text());
  if (auto checked = check_device(*device, configuration); !checked) {
    return fail(kSetUpFailed, checked.error().text());
  }
  const auto wall = choose_wall(configuration, device->descriptor());
  if (!wall) return fail(kSetUpFailed, wall.error().text());

  Attended attended;
  if (configuration.is_publishing()) {
    auto touches = scene::TouchSupplier::create(node, configuration.events, configuration.device);
    if (!touches) return fail(kSetUpFailed, touches.error().text());
    attended.touches = std::move(*touches);
  }

  const LoopConfig config = loop_config(configuration, *wall);
  const auto loop = std::make_unique<Loop>(*device, config);
  std::printf("%s at %s: a %s %s of %.0f N/m and %.2g N s/m, at %.0f Hz\n",
              printable(configuration.device).c_str(), printable(device->url()).c_str(),
              configuration.render.c_str(), configuration.scene.c_str(),
              wall->stiffness_newton_per_m, wall->damping_newton_s_per_m, configuration.rate_hz);
  std::fflush(stdout);
  LocalWall local_wall(*device, *wall, configuration.patience);
  if (config.is_local) {
    attended.wall = &local_wall;
    if (auto set = local_wall.set(rt::now()); !set) {
      return fail(kSetUpFailed,
                  configuration.device + " can't render the wall: " + set.error().text);
    }
  }
  if (auto started = loop->start(); !started) return fail(kSetUpFailed, started.error().text());
  auto served = serve_wall(node, configuration, *device, *wall, *loop, local_wall);
  if (!served) {
    loop->stop();
    loop->join();
    return fail(kSetUpFailed, served.error().text());
  }
  const auto wall_loss = watch(*loop, attended, stop, configuration.live);
  served->reset();
  loop->join();
  std::printf("\n%s%s", table_text(loop->statistics()).c_str(),
              feel_text(loop->statistics().feel, config).c_str());
  std::fflush(stdout);
  if (const auto loss = loop->loss() ? loop->loss() : wall_loss) {
    return fail(kDeviceLost, configuration.device + " " + loss_text(*device, *loss));
  }
  static_cast<void>(device->release());
  return 0;
}

}  // namespace
}  // namespace rtpm::servo

int main(int argc, char** argv) {
  rtpm::servo::Configuration configuration;
  if (const auto exit_code = rtpm::servo::read_configuration(argc, argv, configuration)) {
    return *exit_code;
  }
  return rtpm::servo::serve(configuration);
}
