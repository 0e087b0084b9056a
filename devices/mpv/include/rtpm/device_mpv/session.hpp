#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/time.hpp"
#include "rtpm/device_mpv/player.hpp"
#include "rtpm/device_mpv/protocol.hpp"
#include "rtpm/device_mpv/transport.hpp"

namespace rtpm::device_mpv {

/// The conversation with one player: requests its state once per period and sends changes of the
/// request. The newest request wins: while the player is seeking, no further seek is sent. The
/// transport provides the time, so that tests need no clock.
/// @ownership refers to its transport, which must outlive it
/// @threads  one at a time
/// @realtime set-up only
class Session {
 public:
  /// Times without a report after which the player is late, and then gone.
  static constexpr Duration kLateAfter = std::chrono::milliseconds{100};
  static constexpr Duration kGoneAfter = std::chrono::seconds{1};
  /// How long a seek may take before another one is sent.
  static constexpr Duration kSeekMax = std::chrono::seconds{1};

  Session(Transport& transport, Duration period);

  /// Sends pending commands and reads what has arrived; waits for at most `patience`.
  /// @param request  if nullopt, only requests the state
  /// @return false if the player is gone
  [[nodiscard]] bool step(const std::optional<PlayerRequest>& request, Duration patience);

  [[nodiscard]] const PlayerState& state() const noexcept { return state_; }
  /// Whether no report arrived for kLateAfter.
  [[nodiscard]] bool is_late() const { return transport_.now() - reported_at_ > kLateAfter; }
  /// Number of lines that were unreadable or too long.
  [[nodiscard]] std::uint64_t corrupt_count() const noexcept {
    return unreadable_count_ + cutter_.overlong_count();
  }

 private:
  /// The properties in the order in which they are read: if a seek ends meanwhile, the position
  /// already shows its result.
  enum Question : std::uint8_t {
    kPosition,
    kDuration,
    kSpeed,
    kFrameRate,
    kPause,
    kSeeking,
    kQuestionCount
  };

  [[nodiscard]] bool ask(MonotonicTime now);
  [[nodiscard]] bool send_changes(const PlayerRequest& request, MonotonicTime now);
  [[nodiscard]] bool send_rate(float rate);
  [[nodiscard]] bool send(std::string_view name, std::initializer_list<Word> arguments);
  void take(const Message& message);
  void finish(MonotonicTime now);

  Transport& transport_;
  Duration period_;
  LineCutter cutter_{};
  PlayerState state_{};
  std::int64_t last_id_ = 0;
  /// The id of the kPosition request in the current round; the other ids follow it. 0 between
  /// rounds.
  std::int64_t round_id_ = 0;
  std::array<std::optional<Reply>, kQuestionCount> answers_{};
  MonotonicTime next_round_;
  MonotonicTime reported_at_;
  std::uint64_t unreadable_count_ = 0;

  std::optional<float> sent_rate_{};
  std::optional<bool> sent_backwards_{};
  float sent_seek_s_ = -1;
  std::optional<MonotonicTime> seeking_since_{};
  /// Rounds that started before the seek was sent do not show that it has ended.
  std::int64_t seek_id_ = 0;
};

}  // namespace rtpm::device_mpv
