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
/// Longest life of a command.
inline constexpr std::uint16_t kWatchdogMaxMs = 1000;

/// The number of channels of each kind, which fixes the size of a state and a command.
struct BoardShape {
  std::size_t joint_count = 0;
  std::size_t analog_count = 0;
  std::size_t button_count = 0;
  std::size_t output_count = 0;
};

/// A board's own description. Its numbers are finite, its counts within the driver's limits.
struct BoardDescription {
  std::uint32_t nonce = 0;  ///< The answered hello's nonce; 0 if the board has just started.
  double rate_hz = 0;       ///< Commands per second that the board answers.
  std::string name{};
  std::string serial{};  ///< Empty if it has none.
  std::vector<driver::Joint> joints{};
  std::vector<driver::Analog> analogs{};
  std::vector<std::string> buttons{};
  std::vector<driver::Output> outputs{};

  [[nodiscard]] BoardShape shape() const noexcept;
  /// Whether rate and channels are the same, whatever the name, serial number and nonce.
  [[nodiscard]] bool has_channels_of(const BoardDescription& other) const;
};

/// @param payload  payload of a frame kDescription
/// @realtime set-up only
/// @errors   its fault, as a clause
[[nodiscard]] expected<BoardDescription, std::string> parse_description(ConstBytes payload);

/// A board as it was when it took a measurement. Every number is finite.
/// @ownership plain value, trivially copyable
struct BoardState {
  std::uint16_t answered = 0;  ///< Sequence of the command that it answers.
  bool is_watchdog_over = false;
  bool is_saturated = false;         ///< It applies less than commanded.
  std::uint8_t bad_frame_count = 0;  ///< Frames that the board dropped, modulo 256.
  std::uint32_t time_us = 0;         ///< The board's clock, modulo 2^32.
  std::uint16_t buttons = 0;
  std::array<float, driver::kJointCountMax> positions{};
  std::array<float, driver::kJointCountMax> velocities{};
  std::array<float, driver::kJointCountMax> efforts{};
  std::array<float, driver::kAnalogCountMax> analogs{};
  std::array<float, driver::kOutputCountMax> outputs{};
};

/// @param payload  payload of a frame kState
/// @return nullopt for another size, a number that is not finite, or a button that the board
///         does not have
/// @realtime alloc-free
[[nodiscard]] std::optional<BoardState> parse_state(ConstBytes payload,
                                                    const BoardShape& shape) noexcept;

/// The outputs and efforts that a board shall apply.
/// @ownership plain value, trivially copyable
struct BoardCommand {
  bool is_on = false;             ///< If false, efforts are 0 and outputs safe, whatever follows.
  std::uint16_t watchdog_ms = 1;  ///< 1 to kWatchdogMaxMs.
  std::array<float, driver::kJointCountMax> efforts{};
  std::array<float, driver::kOutputCountMax> outputs{};
};

inline constexpr std::size_t kCommandSizeMax =
    3 + 4 * (driver::kJointCountMax + driver::kOutputCountMax);

/// @return bytes written to `payload`, which has kCommandSizeMax
/// @realtime alloc-free
[[nodiscard]] std::size_t write_command(const BoardCommand& command, const BoardShape& shape,
                                        MutableBytes payload) noexcept;

/// Bytes on the line, delimiter included, of a command and its answer.
[[nodiscard]] std::size_t exchange_size(const BoardShape& shape) noexcept;

}  // namespace rtpm::device_serial
