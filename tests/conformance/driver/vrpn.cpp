#include "../../unit/vrpn/served.hpp"
#include "drivers.hpp"
#include "rtpm/device_vrpn/vrpn_driver.hpp"

// The driver of VRPN's trackers, with a server in this program.
namespace rtpm::test {
namespace {

std::unique_ptr<driver::Driver> make_vrpn() {
  static vrpn::test::Served served;
  return std::make_unique<device_vrpn::VrpnDriver>(
      device_vrpn::Settings{.port = served.port(), .tracker = "Arm0"}, "vrpn-1", "vrpn/base");
}

[[maybe_unused]] const bool kIsAdded = add_driver({"Vrpn", &make_vrpn});

}  // namespace
}  // namespace rtpm::test
