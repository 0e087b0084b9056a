#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/time.hpp"
#include "rtpm/device_mpv/player.hpp"
#include "rtpm/device_mpv/protocol.hpp"
#include "rtpm/device_mpv/transport.hpp"

namespace rtpm::device_mpv {

/// The conversation with one player: asks for its state once per period, sends changes of the
/// request. The newest request wins: while the player seeks, no further seek is sent. The transport
/// provides the time, so that a test needs no clock.
/// @ownership refers to its transport, which must outlive it
/// @threads  one at a time
/// @realtime set-up only
class Session {
 public:
  /// Times without a report after which the player is kLate, then gone.
  static constexpr Duration kLateAfter = std::chrono::milliseconds{100};
  static constexpr Duration kGoneAfter = std::chrono::seconds{1};
  /// How long a seek may last before another one is sent.
  static constexpr Duration kSeekMax = std::chrono::seconds{1};

  Session(Transport& transport, Duration period);

  /// Sends what is due and takes what came; waits for at most `patience`.
  /// @param request  nullopt only asks for the state
  /// @return false if the player is gone
  [[nodiscard]] bool step(const std::optional<PlayerRequest>& request, Duration patience);

  [[nodiscard]] const PlayerState& state() const noexcept { return state_; }
  /// No report for kLateAfter.
  [[nodiscard]] bool is_late() const { return transport_.now() - reported_at_ > kLateAfter; }
  /// Lines that were unreadable or too long.
  [[nodiscard]] std::uint64_t corrupt_count() const noexcept {
    return unreadable_count_ + cutter_.overlong_count();
  }

 private:
  /// Properties in the order of reading: a position whose seek ends meanwhile is shown already.
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
  /// The request of kPosition of the round under way; the others follow it. 0 between rounds.
  std::int64_t round_id_ = 0;
  std::array<std::optional<Reply>, kQuestionCount> answers_{};
  MonotonicTime next_round_;
  MonotonicTime reported_at_;
  std::uint64_t unreadable_count_ = 0;

  std::optional<float> sent_rate_{};
  std::optional<bool> sent_backwards_{};
  float sent_seek_s_ = -1;
  std::optional<MonotonicTime> seeking_since_{};
  /// Rounds asked before the seek was sent do not show that it has ended.
  std::int64_t seek_id_ = 0;
};

}  // namespace rtpm::device_mpv
