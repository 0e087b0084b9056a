#pragma once

#include <string>

namespace rtpm::transport::os {

/// A path of an open folder that is short, as a UNIX socket's path may be; where the system has
/// none, the folder's own.
/// @realtime set-up only
[[nodiscard]] std::string short_path_of(int folder, const std::string& path);

}  // namespace rtpm::transport::os
