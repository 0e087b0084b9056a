#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::gvd {

/// The stored state of a device's emergency stops.
struct StopState {
  static constexpr std::size_t kObeyedCountMax = 256;

  bool is_stopped = false;
  /// The newest system-wide requests that it has obeyed, oldest first.
  std::vector<std::uint64_t> obeyed{};
  friend bool operator==(const StopState&, const StopState&) = default;
};

/// The emergency stop of one device on disk: a text file in a folder, named by model and serial
/// number.
/// @ownership a value
/// @threads  one at a time
/// @realtime set-up only
class StopFile {
 public:
  StopFile(const std::string& folder, std::string_view model, std::string_view serial);

  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  /// Reads the file. If there is none, the device is not stopped.
  /// @errors   names file, cause and remedy: it can't be read, or is not a stop file. The device
  ///           then counts as stopped.
  [[nodiscard]] expected<StopState, SetupError> load() const;
  /// Replaces the file atomically and durably. Creates the folder.
  /// @errors   an error of the operating system, with the file's name
  [[nodiscard]] expected<void, SetupError> save(const StopState& state) const;

 private:
  std::string folder_;
  std::string path_;
};

}  // namespace rtpm::gvd
