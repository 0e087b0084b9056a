#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/driver/command.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"

/// Contents of frames: a board's description and state, and the host's commands.
namespace rtpm::device_serial {

inline constexpr std::size_t kBoardTextSizeMax = 31;  ///< In bytes.
inline constexpr double kBoardRateMaxHz = 4000;
/// The longest time for which a command stays valid.
inline constexpr std::uint16_t kWatchdogMaxMs = 1000;

/// The number of channels of each kind; it determines the size of a state and of a command.
struct BoardShape {
  std::size_t joint_count = 0;
  std::size_t analog_count = 0;
  std::size_t button_count = 0;
  std::size_t output_count = 0;
};

/// A board's description of itself. Its numbers are finite, and its counts are within the driver's
/// limits.
struct BoardDescription {
  /// The nonce of the hello that this answers; 0 if the board has just started.
  std::uint32_t nonce = 0;
  double rate_hz = 0;  ///< The number of commands per second that the board answers.
  std::string name{};
  std::string serial{};  ///< Empty if it has no serial number.
  std::vector<driver::Joint> joints{};
  std::vector<driver::Analog> analogs{};
  std::vector<std::string> buttons{};
  std::vector<driver::Output> outputs{};

  [[nodiscard]] BoardShape shape() const noexcept;
  /// Whether rate and channels are equal, ignoring name, serial number and nonce.
  [[nodiscard]] bool has_channels_of(const BoardDescription& other) const;
};

/// @param payload  the payload of a kDescription frame
/// @realtime set-up only
/// @errors   the fault, as a clause
[[nodiscard]] expected<BoardDescription, std::string> parse_description(ConstBytes payload);

/// The state of a board at the time of a measurement. Every number is finite.
/// @ownership plain value, trivially copyable
struct BoardState {
  std::uint16_t answered = 0;  ///< Sequence number of the command that this answers.
  bool is_watchdog_over = false;
  bool is_saturated = false;         ///< The board applies less effort than commanded.
  std::uint8_t bad_frame_count = 0;  ///< Number of frames that the board dropped, modulo 256.
  std::uint32_t time_us = 0;         ///< Board time, modulo 2^32.
  std::uint16_t buttons = 0;
  std::array<float, driver::kJointCountMax> positions{};
  std::array<float, driver::kJointCountMax> velocities{};
  std::array<float, driver::kJointCountMax> efforts{};
  std::array<float, driver::kAnalogCountMax> analogs{};
  std::array<float, driver::kOutputCountMax> outputs{};
};

/// @param payload  the payload of a kState frame
/// @return nullopt if the size is wrong, a number is not finite, or a button does not exist
/// @realtime alloc-free
[[nodiscard]] std::optional<BoardState> parse_state(ConstBytes payload,
                                                    const BoardShape& shape) noexcept;

/// The outputs and efforts that the board is to apply.
/// @ownership plain value, trivially copyable
struct BoardCommand {
  /// If false, efforts are 0 and outputs safe, regardless of the other members.
  bool is_on = false;
  std::uint16_t watchdog_ms = 1;  ///< From 1 to kWatchdogMaxMs.
  std::array<float, driver::kJointCountMax> efforts{};
  std::array<float, driver::kOutputCountMax> outputs{};
};

inline constexpr std::size_t kCommandSizeMax =
    3 + 4 * (driver::kJointCountMax + driver::kOutputCountMax);

/// @return the number of bytes written to `payload`, which must have kCommandSizeMax bytes
/// @realtime alloc-free
[[nodiscard]] std::size_t write_command(const BoardCommand& command, const BoardShape& shape,
                                        MutableBytes payload) noexcept;

/// Bytes on the line for a command and its answer, including delimiters.
[[nodiscard]] std::size_t exchange_size(const BoardShape& shape) noexcept;

}  // namespace rtpm::device_serial
