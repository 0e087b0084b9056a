#include "drivers.hpp"
#include "rtpm/device_falcon/falcon_driver.hpp"
#include "scripted_falcon.hpp"

namespace rtpm::test {
namespace {

[[maybe_unused]] const bool kIsAdded =
    add_driver({"Falcon", [] {
                  return std::make_unique<device_falcon::FalconDriver>(
                      device_falcon::FalconConfig{.serial = "FALCON01"},
                      open_scripted(std::make_shared<FalconModel>()));
                }});

}  // namespace
}  // namespace rtpm::test
