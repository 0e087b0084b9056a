#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/device_mpv/transport.hpp"

namespace rtpm::test {

/// Faults of a player.
enum class PlayerFault : std::uint8_t {
  kNone,
  kDies,           ///< The connection ends.
  kHangs,          ///< It reads, but never answers.
  kGarbage,        ///< Each answer is text but not JSON.
  kWrongTypes,     ///< Each answer is JSON with wrong types.
  kWrongIds,       ///< Each answer names a request that was never made.
  kLate,           ///< Each answer comes kLateness later.
  kLongLine,       ///< A line of 20 kB precedes each answer.
  kSplit,          ///< Answers arrive byte by byte.
  kFull,           ///< It does not read, and its buffer is full.
  kNothingLoaded,  ///< Each property is unavailable, and each seek fails.
};
inline constexpr PlayerFault kLastPlayerFault = PlayerFault::kNothingLoaded;

/// A model of mpv on a simulated time line, which only receive() advances.
/// @threads  one at a time
class ScriptedPlayer final : public device_mpv::Transport {
 public:
  static constexpr double kDurationSeconds = 20;
  static constexpr double kFrameSeconds = 0.04;
  static constexpr Duration kLateness = std::chrono::milliseconds{300};

  /// @param faulty_from  the index of the command, from 0, at which the fault begins
  explicit ScriptedPlayer(PlayerFault fault = PlayerFault::kNone, std::uint64_t faulty_from = 0)
      : fault_(fault), faulty_from_(faulty_from) {}

  [[nodiscard]] bool send(std::string_view bytes) override;
  [[nodiscard]] device_mpv::Received receive(std::span<char> buffer, Duration patience) override;
  [[nodiscard]] MonotonicTime now() const override { return now_; }

  /// The commands other than get_property, such as "seek 5.0 absolute+exact".
  [[nodiscard]] const std::vector<std::string>& commands() const noexcept { return commands_; }
  [[nodiscard]] double position_s() const noexcept { return position_s_; }
  /// Sets how long a seek shows the old picture.
  void set_seek_time(Duration time) noexcept { seek_time_ = time; }
  /// Stops at the end of the film, as mpv does with --keep-open.
  void advance(Duration time);
  /// Ends the fault, or begins another one.
  void set_fault(PlayerFault fault) noexcept { fault_ = fault; }

 private:
  struct Pending {
    MonotonicTime due;
    std::string bytes;
  };
  void take(const std::string& line);
  [[nodiscard]] bool is_faulty() const noexcept { return command_count_ > faulty_from_; }
  void answer(std::int64_t request_id, const std::string& data);
  [[nodiscard]] std::string value_of(const std::string& property) const;

  PlayerFault fault_;
  std::uint64_t faulty_from_;
  std::uint64_t command_count_ = 0;
  MonotonicTime now_{std::chrono::seconds{5000}};
  std::deque<Pending> pending_{};
  std::vector<std::string> commands_{};
  Duration seek_time_{0};
  MonotonicTime seek_end_{};
  double position_s_ = 0;
  double speed_ = 1;
  bool is_backwards_ = false;
  bool is_paused_ = true;
};

}  // namespace rtpm::test
