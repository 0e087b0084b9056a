#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/parameter.hpp"

namespace rtpm::gvd {

/// A loaded settings file.
struct StoredSettings {
  std::vector<driver::ParameterSetting> settings{};  ///< Valid for the given specifications.
  /// A sentence for each parameter in the file that is unknown, or no longer valid.
  std::vector<std::string> ignored{};
};

/// The saved parameters of one device: a JSON file in a folder. Model and serial number form its
/// name and are repeated inside, with a checksum. It holds the values that differ from their
/// defaults.
/// @ownership a value
/// @threads  one at a time
/// @realtime set-up only
class SettingsStore {
 public:
  static constexpr std::size_t kFileSizeMax = std::size_t{256} * 1024;

  SettingsStore(const std::string& folder, std::string model, std::string serial);

  [[nodiscard]] const std::string& path() const noexcept { return path_; }

  /// Reads the file; if it is missing, there are no settings. Parameters that `specs` lacks are
  /// kept for the next save().
  /// @errors   names file, cause and remedy: unreadable, truncated, damaged or edited, of a later
  ///           version, of another model or serial number
  [[nodiscard]] expected<StoredSettings, SetupError> load(
      std::span<const driver::ParameterSpec> specs);
  /// Replaces the file atomically and durably. Creates the folder if its parent exists.
  /// @errors   an error of the operating system, with the file's name
  [[nodiscard]] expected<void, SetupError> save(
      std::span<const driver::ParameterSetting> settings) const;

 private:
  std::string folder_;
  std::string model_;
  std::string serial_;
  std::string path_;
  std::map<std::string, std::string> unknown_{};  ///< Name to JSON.
};

}  // namespace rtpm::gvd
