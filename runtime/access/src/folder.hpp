#pragma once

#include <string>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::access {

/// Creates the folder of the file at `path` if it does not exist, for this user alone.
[[nodiscard]] expected<void, SetupError> make_folder_of(const std::string& path);

}  // namespace rtpm::access
