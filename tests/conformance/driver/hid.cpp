#include "drivers.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/device_hid/hid_driver.hpp"
#include "scripted_hid.hpp"

namespace rtpm::test {
namespace {

std::unique_ptr<driver::Driver> make_hid(std::size_t kind, bool is_bluetooth) {
  auto hid = device_hid::HidDriver::create(system_with(make_model(kind, is_bluetooth)),
                                           {.torque_newton_metre = 2}, "hid0");
  RTPM_ASSERT(hid.has_value(), "the HID model could not be opened");
  return std::move(*hid);
}

[[maybe_unused]] const bool kAreAdded =
    add_driver({"HidSpaceMouse", [] { return make_hid(0, false); }}) &&
    add_driver({"HidGamePad", [] { return make_hid(1, false); }}) &&
    add_driver({"HidDualShock4", [] { return make_hid(2, true); }}) &&
    add_driver({"HidDualSense", [] { return make_hid(3, false); }}) &&
    add_driver({"HidOpenFfBoard", [] { return make_hid(4, false); }});

}  // namespace
}  // namespace rtpm::test
