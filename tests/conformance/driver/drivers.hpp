#pragma once

#include <vector>

#include "driver_suite.hpp"

namespace rtpm::test {

/// Every driver of this tree.
[[nodiscard]] std::vector<DriverUnderTest> drivers_under_test();

}  // namespace rtpm::test
