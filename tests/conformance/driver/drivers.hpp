#pragma once

#include <vector>

#include "driver_suite.hpp"

namespace rtpm::test {

/// Every driver of this build.
[[nodiscard]] std::vector<DriverUnderTest> drivers_under_test();

/// Adds a driver before main(): `const bool kIsAdded = add_driver({"Falcon", …});`
bool add_driver(DriverUnderTest driver);

}  // namespace rtpm::test
