#pragma once

#include <string>
#include <string_view>

namespace rtpm::gvd {

/// The path of a device's file in `folder`: "FOLDER/MODEL@SERIAL" and `ending`. Distinct devices
/// have distinct paths.
/// @realtime set-up only
[[nodiscard]] std::string device_file(const std::string& folder, std::string_view model,
                                      std::string_view serial, std::string_view ending);

}  // namespace rtpm::gvd
