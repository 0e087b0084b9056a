#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "live/callbacks.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/media/medium_reader.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/viewers/messages.hpp"

namespace rtpm::console {

/// A picture of a camera for its subscribers, or why there is none.
struct MediumView {
  std::string name{};
  viewers::Type type{};
  std::string message{};  ///< A foxglove.CompressedVideo or CompressedImage; empty: a report.
  std::uint64_t log_time_ns = 0;  ///< The time of its capture.
  bool is_key = true;
  std::string frame{};
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  double rate_hz = 0;
  Duration uncertainty{};
  std::uint64_t lost_count = 0;
  std::string problem{};
};

/// Reads the cameras that browsers watch. Pictures that its receiver has not taken yet make the
/// next ones drop, up to the next key frame.
/// @ownership refers to its node and receiver
/// @threads  set_watched(): any; look(): one; the receiver runs on the web server's thread
class MediaWatch {
 public:
  /// At most this many pictures of a camera wait for the web server's thread.
  static constexpr int kWaitingMax = 4;

  MediaWatch(rpc::Node& node, Post post, std::function<void(const MediumView&)> receive);
  ~MediaWatch();

  /// The cameras with a subscriber; others are not read.
  void set_watched(std::set<std::string> names);
  /// Starts and ends reading. Call it periodically.
  void look();
  /// Ends all reading.
  void stop();

 private:
  class Camera;

  rpc::Node& node_;
  Post post_;
  std::function<void(const MediumView&)> receive_;
  std::mutex mutex_{};
  std::set<std::string> watched_{};  ///< Guarded by `mutex_`.
  std::map<std::string, std::unique_ptr<Camera>> cameras_;
};

}  // namespace rtpm::console
