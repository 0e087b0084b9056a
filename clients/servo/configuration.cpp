#include "configuration.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "rtpm/models/check.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/options/options.hpp"

namespace rtpm::servo {
namespace {

scene::Shape shape_of(std::string_view name) {
  for (const scene::Shape shape : {scene::Shape::kSphere, scene::Shape::kTexture}) {
    if (to_string(shape) == name) return shape;
  }
  return scene::Shape::kPlane;
}

bool has_force_along(const driver::Descriptor& device, std::string_view axis) {
  return std::ranges::any_of(
      device.axes, [axis](const driver::Axis& one) { return one.name == axis && one.is_actuated; });
}

/// The default wall's share of its passivity bound.
constexpr double kShareOfBound = 0.75;

std::string shown(double number) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g", number);
  return text.data();
}

}  // namespace

double stiffness_bound_of(const Configuration& configuration, const driver::Descriptor& device,
                          double damping_newton_s_per_m) {
  const auto device_period = std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(1.0 / std::max(device.rate_hz, 1.0)));
  if (configuration.is_local()) {
    const auto limits = gvd::ModelLimits::for_device(device, device_period);
    if (damping_newton_s_per_m >= limits.damping_newton_s_per_m_max) return 0;
    return limits.stiffness_newton_per_m_max *
           (1 - damping_newton_s_per_m / limits.damping_newton_s_per_m_max);
  }
  return std::min(stiffness_bound(device.limits.damping_newton_s_per_m, damping_newton_s_per_m,
                                  configuration.period(), device_period),
                  device.limits.stiffness_newton_per_m_max);
}

std::optional<int> read_configuration(int argc, const char* const* argv,
                                      Configuration& configuration) {
  configuration.registry = names::kThisHost;
  options::Options options(
      "rtpm-servo",
      "renders a virtual wall on a haptic device and measures every cycle of its loop");
  options.add("device", configuration.device, "The device's name, or its URL");
  options.add_registry(configuration.registry);
  options::add_caller(options, configuration.security);
  options.add("seconds", configuration.seconds, "How long to run; 0: until Ctrl-C", {0, 1e6});
  options.add("cycles", configuration.cycle_count_max,
              "End after so many cycles, if --seconds are not over before; 0: no limit");
  options.add("rate", configuration.rate_hz, "Cycles per second, in Hz", {10, 10000});
  options.add("priority", configuration.priority, "Priority of the loop and its calls");
  options.add("stiffness", configuration.wall.stiffness_newton_per_m,
              "The wall's, in N/m; 0: three quarters of what is passive at this rate", {0, 1e6});
  options.add("damping", configuration.wall.damping_newton_s_per_m, "The wall's, in N s/m",
              {0, 1e4});
  options.add("face", configuration.wall.face_m, "Where the wall's face is, z in metre", {-1, 1});
  options.add_choice("scene", configuration.scene, {"plane", "sphere", "texture"},
                     "What is touched: a flat wall, a ball, or ridges");
  options.add("events", configuration.events,
              "The hub that gets each touch, for rtpm-scene, by name or URL; none: no hub");
  options.add("serve", configuration.serve,
              "Serve the wall's parameters below this name, such as lab/servo; none: nowhere");
  options.add_choice("render", configuration.render, {"remote", "local"},
                     "Where the wall's force is computed: here, or in the device's own loop");
  options::Options rare = options.rare();
  rare.add("delay", configuration.delay,
           "Delays each sample and each command artificially; a local wall does without",
           {Duration{0}, kDelayMax});
  rare.add("hold", configuration.hold, "How long each force stands without a newer one");
  rare.add("deadline", configuration.deadline, "How long one call may take",
           {std::chrono::microseconds{100}, std::chrono::seconds{1}});
  rare.add("patience", configuration.patience,
           "How long calls may fail in a row before the device counts as lost");
  rare.add("recover", configuration.is_recovery, "End a latched fault of the device first");
  rare.add_choice("live", configuration.live, {"rewrite", "lines", "off"},
                  "The line that shows the loop while it runs");
  rare.add_realtime(configuration.realtime);
  rare.add_wait(configuration.wait);
  return options.parse(argc, argv);
}

expected<Wall, SetupError> choose_wall(const Configuration& configuration,
                                       const driver::Descriptor& device) {
  Wall wall = configuration.wall;
  wall.shape = shape_of(configuration.scene);
  for (const std::string axis : {"z", "y", "x"}) {
    const bool is_needed = axis == "z" || wall.shape != scene::Shape::kPlane;
    if (!is_needed || (has_force_along(device, axis) && device.limits.force_newton_max > 0)) {
      continue;
    }
    return setup_error(configuration.device + " is a " +
                           std::string(to_string(device.device_class)) +
                           " device without force along " + axis,
                       "", "choose a haptic device with --device");
  }
  if (configuration.is_local() && wall.shape != scene::Shape::kPlane) {
    return setup_error("--render local has no " + configuration.scene, "",
                       "give --scene plane, or --render remote");
  }
  const double bound = stiffness_bound_of(configuration, device, wall.damping_newton_s_per_m);
  if (bound <= 0) {
    return setup_error("a wall of --damping " + shown(wall.damping_newton_s_per_m) +
                           " N s/m leaves nothing of the device's own " +
                           shown(device.limits.damping_newton_s_per_m) +
                           " N s/m to keep it passive",
                       "", "lower it");
  }
  if (wall.stiffness_newton_per_m > bound) {
    return setup_error(
        "a wall of --stiffness " + shown(wall.stiffness_newton_per_m) + " N/m would buzz",
        "at this rate up to " + shown(bound) + " N/m is passive",
        configuration.is_local() ? "lower it" : "lower it, raise --rate, or give --render local");
  }
  if (wall.stiffness_newton_per_m <= 0) wall.stiffness_newton_per_m = kShareOfBound * bound;
  return wall;
}

}  // namespace rtpm::servo
