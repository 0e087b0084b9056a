#include "rtpm/device_sim/twin.hpp"

#include <algorithm>
#include <utility>

namespace rtpm::device_sim {

driver::Descriptor Twin::identity(driver::DeviceClass device_class, const char* model) const {
  driver::Descriptor descriptor;
  descriptor.device_class = device_class;
  descriptor.model = model;
  descriptor.serial = config_.serial;
  descriptor.frame = config_.frame;
  return descriptor;
}

expected<void, SetupError> Twin::configure(const driver::DriverConfig& config) {
  if (config.period <= Duration{0}) {
    return setup_error("a simulated device needs a period above zero", "", "set --rate");
  }
  period_ = config.period;
  return {};
}

expected<void, SetupError> Twin::activate() {
  time_s_ = 0;
  last_cycle_.reset();
  reset();
  is_active_ = true;
  return {};
}

driver::ExchangeStatus Twin::exchange(const driver::Command& command,
                                      driver::Sample& sample) noexcept {
  if (!is_active_) return driver::ExchangeStatus::kGone;
  const Duration since = last_cycle_ ? command.cycle_time - *last_cycle_ : period_;
  last_cycle_ = command.cycle_time;
  const double elapsed_s =
      std::chrono::duration<double>(std::clamp(since, Duration{0}, kStepMax)).count();
  time_s_ += elapsed_s;
  sample.host_time = command.cycle_time;
  sample.device_time = std::chrono::duration_cast<Duration>(std::chrono::duration<double>(time_s_));
  step(command, elapsed_s, sample);
  return driver::ExchangeStatus::kOk;
}

void set_button(driver::Sample& sample, bool is_pressed) noexcept {
  const std::uint32_t buttons = is_pressed ? 1 : 0;
  if (std::exchange(sample.buttons, buttons) != buttons) ++sample.button_edges[0];
}

// The finaliser of SplitMix64.
double random_share(std::uint64_t seed, std::uint64_t index) noexcept {
  std::uint64_t mixed = seed * 0x9e37'79b9'7f4a'7c15ULL + index;
  mixed = (mixed ^ mixed >> 30) * 0xbf58'476d'1ce4'e5b9ULL;
  mixed = (mixed ^ mixed >> 27) * 0x94d0'49bb'1331'11ebULL;
  mixed ^= mixed >> 31;
  return static_cast<double>(mixed >> 11) / static_cast<double>(std::uint64_t{1} << 53);
}

}  // namespace rtpm::device_sim
