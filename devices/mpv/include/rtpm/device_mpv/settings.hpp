#pragma once

#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_mpv/transport.hpp"

namespace rtpm::device_mpv {

/// The operator's choice of a player: "headless=yes file=CLIP" starts mpv, "socket=PATH" connects
/// to a running one. The values of `file` and `socket` include all following words and spaces.
struct Settings {
  std::string file{};        ///< The file to play; if empty, connects to `socket`.
  std::string socket{};      ///< The --input-ipc-server of a running mpv.
  bool is_headless = false;  ///< Starts mpv without window and sound.
};

/// @errors   an unknown word; neither or both of file and socket
[[nodiscard]] expected<Settings, SetupError> read_settings(std::string_view words);

/// Returns a function that opens a transport to the player. The transport owns the process that it
/// starts: mpv exits with the transport, even if this program is killed.
/// @errors   (from that function) mpv is not installed, no such file, no mpv listens at the socket
[[nodiscard]] OpenTransport open_mpv(Settings settings);

}  // namespace rtpm::device_mpv
