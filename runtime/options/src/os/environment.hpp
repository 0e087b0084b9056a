#pragma once

#include <string>
#include <vector>

namespace rtpm::options::os {

/// The variables of the environment, each as "NAME=value".
[[nodiscard]] std::vector<std::string> environment();

}  // namespace rtpm::options::os
