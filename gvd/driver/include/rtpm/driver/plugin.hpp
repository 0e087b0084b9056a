#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "rtpm/base/compiler.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::driver {

/// Incremented when Driver, Sample, Command or Descriptor changes without changing its size.
inline constexpr std::uint32_t kPluginAbi = 1;
inline constexpr std::uint32_t kPluginMagic = 0x52'54'50'44;  ///< "RTPD".
/// The one symbol of a plug-in.
inline constexpr const char* kPluginSymbol = "rtpm_driver_plugin";

/// The structure that a plug-in exports. Before calling into the plug-in, a host compares all
/// members above `create` with its own.
struct Plugin {
  std::uint32_t magic = kPluginMagic;
  std::uint32_t abi = kPluginAbi;
  std::uint32_t sample_size = sizeof(Sample);
  std::uint32_t command_size = sizeof(Command);
  std::uint32_t descriptor_size = sizeof(Descriptor);
  std::uint32_t compiler_abi = kCompilerAbi;
  /// Creates a driver from the operator's arguments.
  /// @errors   described in words with the remedy
  expected<std::unique_ptr<Driver>, SetupError> (*create)(std::string_view arguments) = nullptr;
};

}  // namespace rtpm::driver

// Exports the symbol; CMake says how on Windows.
#ifndef RTPM_PLUGIN_EXPORT
#define RTPM_PLUGIN_EXPORT [[gnu::visibility("default")]]
#endif

/// Turns a shared library into a plug-in for rtpm-deviced. Use it once, in one source, outside any
/// namespace. `function` becomes Plugin::create.
// NOLINTNEXTLINE(cppcoreguidelines-macro-usage)
#define RTPM_DRIVER_PLUGIN(function)                                            \
  extern "C" RTPM_PLUGIN_EXPORT const rtpm::driver::Plugin rtpm_driver_plugin { \
    .create = (function)                                                        \
  }
