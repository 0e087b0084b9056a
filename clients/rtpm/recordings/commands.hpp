#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "cli/context.hpp"

// Commands for recordings.
namespace rtpm::tool {

void add_record(CLI::App& program, Context& context);
void add_session(CLI::App& program, Context& context);
void add_play(CLI::App& program, Context& context);
/// Which recorded parameters are set at devices.
struct RestoreRequest {
  std::string file{};
  std::vector<std::string> devices{};  ///< Their recorded names; empty for all.
  std::string folder{};                ///< Put before each name.
  Duration from{};                     ///< The values at this time after the first message.
};
/// Sets the recorded parameters of each device again, all or none of a device.
/// @return the exit code: kFailed if one device was refused
[[nodiscard]] int restore_parameters(Context& context, const RestoreRequest& request);
/// Cuts the pictures and the sound of a recorded camera out.
/// @param medium  empty: the only one
/// @return the exit code
[[nodiscard]] int export_video(Context& context, const std::string& file, const std::string& output,
                               const std::string& medium);
/// `rtpm bag export`.
void add_export(CLI::App& group, Context& context);
void add_bag(CLI::App& program, Context& context);

}  // namespace rtpm::tool
