// Any events from an input device that claims anything add up to a state within the descriptor.

#include <linux/input.h>

#include <cmath>
#include <cstdint>

#include "rtpm/base/assert.hpp"
#include "rtpm/device_evdev/accumulator.hpp"
#include "script.hpp"

using namespace rtpm;

namespace {

/// Chooses numbers of 16 bits more often than those of all 32.
std::int32_t value_of(fuzz::Script& script) {
  const std::uint32_t number = script.number();
  return static_cast<std::int32_t>((number & 0x8000'0000u) != 0 ? number : number & 0xffffu);
}

device_evdev::Capabilities capabilities_of(fuzz::Script& script) {
  device_evdev::Capabilities capabilities;
  for (int count = script.byte() % 12; count > 0; --count) {
    capabilities.absolute.push_back({.code = static_cast<std::uint16_t>(script.byte() % ABS_CNT),
                                     .minimum = value_of(script),
                                     .maximum = value_of(script),
                                     .flat = value_of(script),
                                     .resolution = value_of(script),
                                     .value = value_of(script)});
  }
  for (int count = script.byte() % 10; count > 0; --count)
    capabilities.relative.push_back(static_cast<std::uint16_t>(script.byte() % REL_CNT));
  for (int count = script.byte() % 20; count > 0; --count)
    capabilities.keys.push_back(static_cast<std::uint16_t>(script.number() % KEY_CNT));
  if (script.byte() % 2 == 1) capabilities.pressed = capabilities.keys;
  for (int count = script.byte() % 8; count > 0; --count)
    capabilities.force_feedback.push_back(
        static_cast<std::uint16_t>(FF_EFFECT_MIN + script.byte() % 0x20));
  capabilities.effect_count = static_cast<std::int8_t>(script.byte());
  capabilities.is_accelerometer = script.byte() % 2 == 1;
  return capabilities;
}

void check(const device_evdev::State& state, const device_evdev::Layout& layout) {
  const driver::Descriptor& has = layout.descriptor;
  for (std::size_t i = 0; i < has.analogs.size(); ++i) {
    RTPM_ASSERT(state.analogs[i] >= has.analogs[i].low && state.analogs[i] <= has.analogs[i].high,
                "an analog is within its range");
  }
  for (std::size_t i = 0; i < has.joints.size(); ++i) {
    RTPM_ASSERT(std::isfinite(state.joints[i]) && std::isfinite(state.velocities[i]),
                "a joint is finite");
    RTPM_ASSERT(has.joints[i].low == has.joints[i].high ||
                    (state.joints[i] >= has.joints[i].low && state.joints[i] <= has.joints[i].high),
                "a wheel is within its range");
  }
  RTPM_ASSERT(state.buttons >> has.buttons.size() == 0, "no button that it does not have");
  for (std::size_t i = 0; i < has.buttons.size(); ++i) {
    RTPM_ASSERT(state.edges[i] % 2 == (state.buttons >> i & 1), "edges fit the state");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Script script(data, size);
  const device_evdev::Capabilities capabilities = capabilities_of(script);
  const device_evdev::Layout layout = device_evdev::make_layout(capabilities, {});
  MonotonicTime now{std::chrono::seconds{1000}};
  device_evdev::Accumulator accumulator(layout, capabilities, {}, now);
  check(accumulator.state(), layout);
  while (script.has_more()) {
    now += Duration{script.byte() * 10'000};
    const std::uint32_t head = script.number();
    // Half of the events have a known type.
    const std::uint32_t type = (head & 0x8000u) != 0 ? head & 0xffffu : head & 0x3u;
    const auto code = static_cast<std::uint16_t>(head >> 16);
    const device_evdev::Event event{now + Duration{value_of(script)},
                                    static_cast<std::uint16_t>(type), code, value_of(script)};
    accumulator.apply(event, now);
    check(accumulator.state(), layout);
    RTPM_ASSERT(accumulator.state().time <= now, "no time of the future");
  }
  return 0;
}
