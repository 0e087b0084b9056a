#include "configuration.hpp"

#include "rtpm/names/defaults.hpp"
#include "rtpm/options/options.hpp"

namespace rtpm::scene {

std::optional<int> read_configuration(int argc, const char* const* argv,
                                      Configuration& configuration) {
  configuration.registry = names::kThisHost;
  options::Options options("rtpm-scene",
                           "draws a haptic device, the solid that it touches, and the force");
  options.add("device", configuration.device, "The device's name");
  options.add("events", configuration.events,
              "The hub of the device's samples and of rtpm-servo's touches, by name or URL");
  options.add_registry(configuration.registry);
  options::add_caller(options, configuration.security);
  options.add("seconds", configuration.seconds, "How long to draw; 0: until Ctrl-C", {0, 1e6});
  options.add("rate", configuration.rate_hz, "Frames per second, in Hz", {1, 100});
  options.add_choice("live", configuration.live, {"rewrite", "lines", "off"},
                     "Draw in the terminal, print a line each second, or nothing");
  options.add("picture", configuration.picture, "The SVG file that the whole run is drawn to");
  if (const auto exit_code = options.parse(argc, argv)) return exit_code;
  if (!configuration.picture.empty() && !configuration.picture.ends_with(".svg")) {
    return options.usage_error("--picture takes a name that ends in .svg");
  }
  return std::nullopt;
}

}  // namespace rtpm::scene
