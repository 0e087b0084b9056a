#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/options/server_options.hpp"

namespace rtpm::camerad {

/// The pipeline of a medium without one: a test picture and a test sound.
inline constexpr const char* kTestPipeline =
    "appsrc name=test_video ! x264enc tune=zerolatency speed-preset=ultrafast key-int-max=30 ! "
    "video/x-h264,profile=baseline ! appsink name=video "
    "appsrc name=test_sound ! appsink name=sound";

/// The options of one camera, microphone or both.
struct MediumSettings {
  std::string name{};  ///< The name in options; also the last component of the registry name.
  std::string pipeline{kTestPipeline};  ///< For GStreamer, with appsink elements video and sound.
  std::string model{"camera"};
  std::string serial{};  ///< By default the name.
  std::string frame{};   ///< By default the name with "_optical".
  Duration
      uncertainty{};  ///< How far capture times may be off; 0: the duration of a picture or piece.
  std::string button{};  ///< The device whose button lights the test picture's lamp.
};

/// The options of rtpm-camerad.
struct Configuration {
  std::string folder = "lab";
  std::vector<std::string> names{};  ///< The media's names, in the order of configuration.
  std::vector<MediumSettings> media{};
  options::ServerSettings settings{};
  std::string settings_folder{};  ///< For saved parameters; empty if they are not saved.
  std::string registry{};
  bool allows_takeover = false;  ///< Takes its registry names over from a running server.

  /// The name in the registry.
  [[nodiscard]] std::string name_of(const MediumSettings& medium) const {
    return folder.empty() ? medium.name : folder + "/" + medium.name;
  }
};

/// The registry URL that means: serve without a registry.
inline constexpr const char* kNoRegistry = "none";

/// Reads file, environment and flags into `configuration`, like options::Options::parse().
[[nodiscard]] std::optional<int> read_configuration(int argc, const char* const* argv,
                                                    Configuration& configuration);

}  // namespace rtpm::camerad
