#include "rtpm/device_sim/biometric_driver.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "settings.hpp"

namespace rtpm::device_sim {
namespace {

double bell(double at, double centre, double width) noexcept {
  const double distance = (at - centre) / width;
  return std::exp(-distance * distance);
}

/// The blood volume in one beat: the pulse and its reflection. `phase` is the fraction of the beat.
double pulse_at(double phase) noexcept {
  return std::min(1.0, 0.9 * bell(phase, 0.2, 0.1) + 0.35 * bell(phase, 0.5, 0.12));
}

/// Breathing raises and lowers the heart rate.
double heart_rate_hz_at(double time_s, double rest_hz) noexcept {
  return rest_hz + 0.06 * std::sin(2 * std::numbers::pi * 0.25 * time_s);
}

/// A slowly changing level plus a response to each stimulus, which rises for a second and then
/// decays.
double skin_conductance_at(std::uint64_t seed, double time_s) noexcept {
  constexpr double kLevel = 5e-6;
  constexpr double kStimulusEveryS = 7;
  const double since_s = std::fmod(time_s, kStimulusEveryS);
  const auto stimulus = static_cast<std::uint64_t>(time_s / kStimulusEveryS);
  const double height = (1 + 2 * random_share(seed, stimulus)) * 1e-6;
  return kLevel + height * (std::exp(-since_s / 2) - std::exp(-since_s / 0.5));
}

}  // namespace

driver::Descriptor BiometricDriver::describe() const {
  driver::Descriptor descriptor =
      identity(driver::DeviceClass::kBiometric, "RTPM simulated biometric sensor");
  descriptor.analogs = {{.name = "pulse", .unit = "1", .low = 0, .high = 1},
                        {.name = "heart_rate", .unit = "Hz", .low = 0, .high = 4},
                        {.name = "skin_conductance", .unit = "S", .low = 0, .high = 50e-6}};
  descriptor.rate_hz = 250;
  return descriptor;
}

std::vector<driver::ParameterSpec> BiometricDriver::parameters() const {
  return {{.name = "pulse.gain",
           .unit = "1",
           .low = 0.1,
           .high = 10,
           .default_value = 1.0,
           .description = "Factor of the pulse, which saturates at 1."},
          {.name = "person.heart_rate_hz",
           .unit = "Hz",
           .low = 0.5,
           .high = 3,
           .default_value = 1.1,
           .description = "The simulated person's mean heart rate."}};
}

expected<void, SetupError> BiometricDriver::set_parameters(
    std::span<driver::ParameterSetting> settings) {
  take(settings, "pulse.gain", pulse_gain_);
  take(settings, "person.heart_rate_hz", rest_hz_);
  return {};
}

void BiometricDriver::step(const driver::Command&, double elapsed_s,
                           driver::Sample& sample) noexcept {
  const double rate_hz = heart_rate_hz_at(time_s(), rest_hz_);
  beat_ += elapsed_s * rate_hz;
  // The sensor saturates at the limit of its range.
  const double pulse = std::min(1.0, pulse_gain_ * pulse_at(beat_ - std::floor(beat_)));
  sample.analogs[0] = static_cast<float>(pulse);
  sample.analogs[1] = static_cast<float>(rate_hz);
  sample.analogs[2] = static_cast<float>(skin_conductance_at(config().seed, time_s()));
}

}  // namespace rtpm::device_sim
