#include "player_channels.hpp"

#include <algorithm>
#include <vector>

namespace rtpm::media {
namespace {

template <class Channel>
std::optional<std::size_t> index_of(const std::vector<Channel>& channels, std::string_view name) {
  const auto found = std::ranges::find(channels, name, &Channel::name);
  if (found == channels.end()) return std::nullopt;
  return static_cast<std::size_t>(found - channels.begin());
}

/// The frame time for a player that states none, or has loaded no video.
constexpr double kFrameSeconds = 0.04;

}  // namespace

expected<PlayerChannels, SetupError> PlayerChannels::of(const std::string& name,
                                                        const driver::Descriptor& player) {
  const auto rate = index_of(player.outputs, "rate");
  const auto seek = index_of(player.outputs, "seek");
  const auto position = index_of(player.analogs, "position");
  if (!rate || !seek || !position) {
    return setup_error(
        name + " is a " + std::string(to_string(player.device_class)) + " device, no player", "",
        "choose a player with --player");
  }
  PlayerChannels channels;
  channels.rate_output_ = *rate;
  channels.seek_output_ = *seek;
  channels.position_ = *position;
  channels.rate_ = index_of(player.analogs, "rate");
  channels.duration_ = index_of(player.analogs, "duration");
  channels.frame_ = index_of(player.analogs, "frame");
  channels.rate_max_ = player.outputs[*rate].high;
  channels.duration_max_s_ = player.analogs[*position].high;
  return channels;
}

PlayerView PlayerChannels::view(const driver::Sample& sample) const noexcept {
  PlayerView view;
  const auto analog = [&](std::optional<std::size_t> index, double otherwise) {
    return index ? static_cast<double>(sample.analogs[*index]) : otherwise;
  };
  view.position_s = analog(position_, 0);
  view.duration_s = analog(duration_, duration_max_s_);
  view.rate = analog(rate_, 0);
  view.frame_s = analog(frame_, 0);
  if (view.frame_s <= 0) view.frame_s = kFrameSeconds;
  return view;
}

driver::Setpoint PlayerChannels::setpoint(double rate, double seek_s) const noexcept {
  std::array<float, driver::kOutputCountMax> outputs{};
  outputs[rate_output_] = static_cast<float>(rate);
  outputs[seek_output_] = static_cast<float>(seek_s);
  return driver::Setpoint::with_outputs(outputs);
}

expected<KnobChannel, SetupError> knob_channel(const std::string& name,
                                               const driver::Descriptor& knob) {
  const auto found = std::ranges::find_if(knob.joints, [](const driver::Joint& joint) {
    return joint.unit == "rad" && joint.low == joint.high && joint.effort_max > 0;
  });
  if (found == knob.joints.end()) {
    return setup_error(name + " is a " + std::string(to_string(knob.device_class)) +
                           " device without a motorised joint that turns without end",
                       "", "choose a dial with --knob");
  }
  return KnobChannel{static_cast<std::size_t>(found - knob.joints.begin()), found->effort_max};
}

}  // namespace rtpm::media
