#pragma once

#include <cstdint>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/recorder.hpp"

namespace rtpm::capture {

/// A channel of a device whose messages are tables of device.fbs.
struct DeviceChannel {
  const char* kind = nullptr;
  const char* leaf = nullptr;  ///< The topic is the device's name and this.
  const char* type = nullptr;  ///< "rtpm.device.Description".
};

/// Adds it with its schema. Its kSchemaIdKey is the fingerprint of rtpm.device.Device.
/// @errors   the file takes no more schemas or channels
[[nodiscard]] expected<std::uint16_t, SetupError> add_device_channel(recording::Recorder& recorder,
                                                                     const std::string& device,
                                                                     const DeviceChannel& channel);

}  // namespace rtpm::capture
