#pragma once

#include <functional>
#include <memory>
#include <ostream>
#include <string>

#include "rtpm/driver/driver.hpp"

namespace rtpm::test {

/// One driver for the suite of driver_suite.cpp. To add your driver, add a line to drivers.cpp.
struct DriverUnderTest {
  std::string name;  ///< Letters and digits.
  std::function<std::unique_ptr<driver::Driver>()> make;

  friend std::ostream& operator<<(std::ostream& out, const DriverUnderTest& test) {
    return out << test.name;
  }
};

}  // namespace rtpm::test
