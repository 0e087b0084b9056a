#include "rtpm/viewers/device_view.hpp"

#include <algorithm>
#include <utility>

namespace rtpm::viewers {
namespace {

/// Viewers keep a scene over a few lost messages, and remove it when the device is silent.
constexpr std::uint64_t kSceneLifetimeNs = 250'000'000;

std::uint64_t interval_of(Type type) noexcept {
  return type == Type::kSceneUpdate ? DeviceView::kForceIntervalNs : DeviceView::kPoseIntervalNs;
}

}  // namespace

DeviceView::DeviceView(std::string device, const driver::Descriptor& descriptor)
    : device_(std::move(device)), frame_(descriptor.frame), workspace_(descriptor.workspace) {
  if (std::ranges::any_of(descriptor.axes, &driver::Axis::is_sensed)) {
    channels_.push_back({device_ + "/pose", Type::kPoseInFrame});
    channels_.push_back({std::string(kTransformTopic), Type::kFrameTransforms});
  }
  if (descriptor.limits.force_newton_max > 0) {
    channels_.push_back({device_ + "/force", Type::kSceneUpdate});
  }
  last_slots_.resize(channels_.size());
}

std::vector<DeviceView::Due> DeviceView::take(const driver::Sample& sample, std::uint64_t time_ns) {
  std::vector<Due> due;
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    // One message for each slot of the time, so that jitter does not lower the rate.
    const std::uint64_t slot = time_ns / interval_of(channels_[i].type);
    if (slot == last_slots_[i]) continue;
    last_slots_[i] = slot;
    due.push_back({i, message_of(channels_[i].type, sample, {time_ns, frame_})});
  }
  return due;
}

Message DeviceView::message_of(Type type, const driver::Sample& sample, const Stamp& stamp) const {
  if (type == Type::kPoseInFrame) return pose_message(stamp, sample.pose);
  if (type == Type::kFrameTransforms) return transform_message(stamp, device_, sample.pose);
  const bool has_models = stamp.time_ns < models_until_ns_;
  return scene_message(stamp,
                       {.device = device_,
                        .position_m = sample.pose.position_m,
                        .force_newton = sample.wrench_applied.force_newton,
                        .models = has_models ? models_.models() : std::span<const gvd::Model>{},
                        .low_m = workspace_.low_m,
                        .high_m = workspace_.high_m,
                        .lifetime_ns = kSceneLifetimeNs});
}

}  // namespace rtpm::viewers
