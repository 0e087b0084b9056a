#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "channels/channel_table.hpp"
#include "live/media_watch.hpp"

namespace rtpm::console {

/// The cameras' channels, "lab/cam0/video".
/// @ownership refers to the channels
/// @threads  the web server's thread
class MediaChannels {
 public:
  explicit MediaChannels(ChannelTable& channels) noexcept : channels_(channels) {}

  /// The media at the registry.
  void set_media(const std::set<std::string>& names);
  /// Those with a subscriber.
  [[nodiscard]] std::set<std::string> watched() const;
  /// Sends a picture to the subscribers, or keeps the report.
  void take(const MediumView& view);
  /// The media as JSON, for the page.
  [[nodiscard]] nlohmann::ordered_json state() const;

 private:
  void advertise(const std::string& name, viewers::Type type);

  ChannelTable& channels_;
  std::map<std::string, MediumView> media_{};  ///< The newest of each, without its picture.
};

}  // namespace rtpm::console
