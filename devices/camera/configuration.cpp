#include "configuration.hpp"

#include "rtpm/names/defaults.hpp"

namespace rtpm::camerad {
namespace {

/// The size limit of one component of a registry name.
constexpr std::size_t kNameSizeMax = 64;

void add_medium(options::Options options, MediumSettings& medium) {
  options.add("pipeline", medium.pipeline,
              "GStreamer's text, as gst-launch-1.0 takes it, with pictures ending in 'appsink "
              "name=video' (H.264 or JPEG), sound in 'appsink name=sound' (S16LE or Opus)");
  options.add("model", medium.model, "The manufacturer's name of it");
  options.add("serial", medium.serial, "Its serial number; empty: its name");
  options.add("frame", medium.frame, "The frame of its pictures; empty: its name and _optical");
  options.add("uncertainty", medium.uncertainty,
              "How far a capture time may be off; 0: the duration of a picture or piece of sound",
              {Duration{0}, std::chrono::seconds{10}});
  options.add("button", medium.button,
              "Test picture: the device, by name or URL, whose first button lights the lamp");
}

void add_media(options::Options& options, Configuration& configuration) {
  options.add("folder", configuration.folder, "The media's names at the registry are FOLDER/NAME");
  options.add_group(
      "media", "medium", configuration.names,
      "The names of cameras and microphones, each with options --medium-NAME-… or in "
      "[medium.NAME]; without: cam0, a test picture and sound",
      kNameSizeMax, [&options, &configuration](const std::vector<std::string>& configured) {
        const auto names = configured.empty() ? std::vector{std::string("cam0")} : configured;
        for (const std::string& name : names)
          configuration.media.push_back({.name = name});
        for (MediumSettings& medium : configuration.media)
          add_medium(options.of_member("medium", medium.name), medium);
      });
}

}  // namespace

std::optional<int> read_configuration(int argc, const char* const* argv,
                                      Configuration& configuration) {
  configuration.registry = names::kThisHost;
  options::Options options("rtpm-camerad", "serves cameras and microphones under names");
  add_media(options, configuration);
  configuration.settings.server.lanes = {
      {.name = "lane-media", .wait = {.strategy = rt::WaitStrategy::kBlock}}};
  options::add_server(options, configuration.settings);
  options::add_caller(options, configuration.settings);
  options.add_registry(configuration.registry);
  options.add("settings", configuration.settings_folder,
              "The folder of saved parameters; empty: they are neither saved nor read");
  options.add("allow-takeover", configuration.allows_takeover,
              "Take the names from another server that holds them, at the start");
  if (const auto exit_code = options.parse(argc, argv)) return exit_code;
  for (MediumSettings& medium : configuration.media) {
    if (medium.serial.empty()) medium.serial = medium.name;
    if (medium.frame.empty()) medium.frame = medium.name + "_optical";
  }
  return std::nullopt;
}

}  // namespace rtpm::camerad
