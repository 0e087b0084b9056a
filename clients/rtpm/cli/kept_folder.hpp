#pragma once

#include <string>

namespace rtpm::tool {

/// The user's folder for persistent files, $XDG_STATE_HOME/rtpm; empty if it can't be created.
[[nodiscard]] std::string kept_folder();

}  // namespace rtpm::tool
