#include "drivers.hpp"
#include "evdev_model.hpp"
#include "rtpm/device_evdev/evdev_driver.hpp"

namespace rtpm::test {
namespace {

/// A driver and the model that it reaches.
struct EvdevUnderTest final : EvdevModel, device_evdev::EvdevDriver {
  explicit EvdevUnderTest(const Capabilities& capabilities)
      : EvdevModel(capabilities), EvdevDriver(access(), {}, "device/base") {}
};

[[maybe_unused]] const bool kIsAdded =
    add_driver({"EvdevPad", [] { return std::make_unique<EvdevUnderTest>(EvdevModel::pad()); }}) &&
    add_driver(
        {"EvdevWheel", [] { return std::make_unique<EvdevUnderTest>(EvdevModel::wheel()); }}) &&
    add_driver({"EvdevDial", [] { return std::make_unique<EvdevUnderTest>(EvdevModel::dial()); }});

}  // namespace
}  // namespace rtpm::test
