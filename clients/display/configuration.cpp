#include "configuration.hpp"

#include "rtpm/names/defaults.hpp"
#include "rtpm/options/options.hpp"

namespace rtpm::display {

std::optional<int> read_configuration(int argc, const char* const* argv,
                                      Configuration& configuration) {
  configuration.registry = names::kThisHost;
  configuration.live = "rewrite";
  options::Options options("rtpm-display", "shows devices of any class, one line each");
  options.add("devices", configuration.devices, "The devices' names");
  options.add("events", configuration.events, "The hub of their events, by name or URL");
  options.add_registry(configuration.registry);
  options::add_caller(options, configuration.security);
  options.add("seconds", configuration.seconds, "How long to show them; 0: until Ctrl-C", {0, 1e6});
  options.add("rate", configuration.rate_hz, "Samples of each device per second, in Hz", {1, 100});
  options.add_choice("live", configuration.live, {"rewrite", "lines"},
                     "Rewrite the lines, or print them each second");
  if (const auto exit_code = options.parse(argc, argv)) return exit_code;
  if (configuration.devices.empty()) return options.usage_error("--devices names no device");
  return std::nullopt;
}

}  // namespace rtpm::display
