#pragma once

#include <string>

namespace rtpm::program {

/// The folder for files that RTPM's programs keep for their user, which need not exist yet:
/// $XDG_STATE_HOME/rtpm or ~/.local/state/rtpm; on Windows %LOCALAPPDATA%\rtpm. Empty if the
/// environment names none.
/// @realtime set-up only
[[nodiscard]] std::string state_folder();

}  // namespace rtpm::program
