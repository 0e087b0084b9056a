#include "configuration.hpp"

#include "rtpm/names/defaults.hpp"
#include "rtpm/options/options.hpp"

namespace rtpm::media {

std::optional<int> read_configuration(int argc, const char* const* argv,
                                      Configuration& configuration) {
  configuration.registry = names::kThisHost;
  options::Options options("rtpm-media", "drives a media player with a knob that can be felt");
  options.add("knob", configuration.knob, "The name of a motorised dial, or its URL");
  options.add("player", configuration.player, "The name of a media player, or its URL");
  options.add_registry(configuration.registry);
  options::add_caller(options, configuration.security);
  options.add_choice("mode", configuration.mode, {"speed", "scrub", "frame"},
                     "What the knob does at first; its button chooses the next");
  options.add("fixed-mode", configuration.has_fixed_mode, "The knob's button changes nothing");
  options.add("seconds", configuration.seconds, "How long to run; 0: until Ctrl-C", {0, 1e6});
  options.add("rate", configuration.rate_hz, "Cycles per second, in Hz", {10, 1000});
  options.add("headless", configuration.is_headless,
              "Print a line each second instead of rewriting one");
  options.add("make-clip", configuration.clip, "Write a clip of 20 s to this file (.y4m) and end");
  options.add("priority", configuration.priority, "Priority of the calls");
  options.add("patience", configuration.patience,
              "How long calls may fail in a row before a device counts as lost");
  return options.parse(argc, argv);
}

}  // namespace rtpm::media
