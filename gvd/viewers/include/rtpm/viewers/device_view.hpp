#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/models/model.hpp"
#include "rtpm/viewers/messages.hpp"

namespace rtpm::viewers {

/// The topic of the transforms of all devices.
inline constexpr std::string_view kTransformTopic = "rtpm/tf";

/// A channel for a viewer.
struct Channel {
  std::string topic{};
  Type type{};
};

/// Turns samples and local models of one device into the messages of its channels, each at its own rate: "NAME/pose"
/// and kTransformTopic if the device measures a position, "NAME/force" if it applies forces.
/// @ownership a value
/// @threads  one; allocates, so not for real-time threads
class DeviceView {
 public:
  /// The rates of messages at most.
  static constexpr std::uint64_t kPoseIntervalNs = 10'000'000;
  static constexpr std::uint64_t kForceIntervalNs = 33'333'334;

  DeviceView(std::string device, const driver::Descriptor& descriptor);

  [[nodiscard]] const std::vector<Channel>& channels() const noexcept { return channels_; }
  /// How long models last unless set again; devices repeat them each second.
  static constexpr std::uint64_t kModelsLifetimeNs = 3'000'000'000;

  /// The local models that the device renders at `time_ns`, for the scenes until kModelsLifetimeNs
  /// later.
  void set_models(const gvd::ModelList& models, std::uint64_t time_ns) noexcept {
    models_ = models;
    models_until_ns_ = time_ns + kModelsLifetimeNs;
  }

  struct Due {
    std::size_t channel = 0;  ///< Index in channels().
    Message message{};
  };
  /// The messages that are due with a sample.
  /// @param time_ns  of its measurement, since 1970 in UTC
  [[nodiscard]] std::vector<Due> take(const driver::Sample& sample, std::uint64_t time_ns);

 private:
  [[nodiscard]] Message message_of(Type type, const driver::Sample& sample,
                                   const Stamp& stamp) const;

  std::string device_;
  std::string frame_;
  driver::Workspace workspace_;
  gvd::ModelList models_{};
  std::uint64_t models_until_ns_ = 0;
  std::vector<Channel> channels_{};
  std::vector<std::uint64_t> last_slots_{};  ///< Each channel's last message.
};

}  // namespace rtpm::viewers
