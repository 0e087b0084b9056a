#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/command.hpp"
#include "rtpm/driver/descriptor.hpp"

/// Reads commands from messages, and refuses those that must not move a device.
namespace rtpm::ros2 {

/// Why a command was dropped.
enum class CommandDrop : std::uint8_t {
  kUnreadable,  ///< Not CDR of its type.
  kStale,       ///< Its stamp is too old, or none.
  kFuture,      ///< Its stamp is too far ahead of this host's clock.
  kOtherFrame,  ///< It is in another frame than the device's.
  kNotFinite,   ///< It has a NaN or an infinity, or a quaternion that is none.
  kOddJoints,   ///< It does not give each joint exactly one kind of value.
  kReplaced,    ///< A newer command came before this one was sent.
  kRefused,     ///< The device refused it, or did not answer.
};
inline constexpr std::size_t kCommandDropCount = 8;
/// "unreadable", "stale stamp" and so on.
[[nodiscard]] std::string_view to_string(CommandDrop drop) noexcept;

/// The topics below a device's name by which it is commanded.
enum class CommandKind : std::uint8_t { kWrench, kPose, kTwist, kJoints };
[[nodiscard]] std::string_view subject_of(CommandKind kind) noexcept;
/// Those that the device has a mode for.
[[nodiscard]] std::vector<CommandKind> command_kinds_of(const driver::Descriptor& descriptor);

/// The condition that a command must meet.
struct CommandTime {
  std::int64_t now_ns = 0;  ///< CLOCK_REALTIME.
  Duration age_max{};       ///< The stamp may differ from `now_ns` by this, either way.
};

/// A command's setpoint. All quantities must be in the device's frame; an empty frame counts as it.
/// Joints are matched by name.
[[nodiscard]] expected<driver::Setpoint, CommandDrop> read_command(
    CommandKind kind, ConstBytes cdr, const driver::Descriptor& descriptor,
    const CommandTime& time);

}  // namespace rtpm::ros2
