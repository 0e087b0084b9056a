#pragma once

#include <string>
#include <utility>
#include <vector>

#include "cli/context.hpp"
#include "cli/output.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::tool {

/// A device as `rtpm info` shows it.
struct DeviceFacts {
  driver::Descriptor descriptor{};
  driver::Sample sample{};  ///< The newest.
  std::string holder{};     ///< "free", "held by …"; empty if the server does not tell.
};

/// Asks the device at `url`.
/// @errors   those of open_device(); it can't be read
[[nodiscard]] expected<DeviceFacts, SetupError> device_facts_of(Context& context,
                                                                const std::string& url);

/// Lines for people: a label and a printable text each.
using FactLines = std::vector<std::pair<std::string, std::string>>;
[[nodiscard]] FactLines lines_of(const DeviceFacts& facts);
/// {"lifecycle", "faults", "lease"}.
[[nodiscard]] Json json_of(const DeviceFacts& facts);

}  // namespace rtpm::tool
