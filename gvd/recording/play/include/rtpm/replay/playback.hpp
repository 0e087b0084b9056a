#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/replay/pace.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::replay {

class Playback;

/// The time between two commands to a playback: a script plays while its turn is the current one.
/// @ownership refers to the playback
/// @threads  the playback's
class Turn {
 public:
  /// Waits until a message is due, to within a millisecond.
  /// @return   false if another command arrived meanwhile
  [[nodiscard]] bool reach(Duration at) const;
  /// When the message is due at this pace; when stepping, immediately.
  [[nodiscard]] MonotonicTime due(Duration at) const;
  /// Waits for `span`.
  /// @return   false if another command arrived meanwhile
  [[nodiscard]] bool wait(Duration span) const;
  [[nodiscard]] bool is_present() const noexcept;

 private:
  friend class Playback;
  Turn(Playback& playback, std::uint64_t number, std::uint64_t round) noexcept
      : playback_(playback), number_(number), round_(round) {}

  Playback& playback_;
  std::uint64_t number_;
  std::uint64_t round_;
};

/// Messages in order of time, which a playback plays.
/// @threads  the playback's
class Script {
 public:
  Script() = default;
  Script(const Script&) = delete;
  Script& operator=(const Script&) = delete;
  virtual ~Script() = default;
  /// Plays the messages from `from` on, each after Turn::reach(). Returns when that returns false.
  /// @errors   reading further messages failed
  [[nodiscard]] virtual expected<void, SetupError> play(Duration from, const Turn& turn) = 0;
  /// Shows the state at a position after a jump.
  /// @errors   those of play()
  [[nodiscard]] virtual expected<void, SetupError> show(Duration, const Turn&) { return {}; }
};

/// Plays a script on its own thread, at a steady pace or in steps, with pauses and jumps.
/// @ownership refers to its script, which must outlive it
/// @threads  any
class Playback {
 public:
  Playback(Script& script, const Pace::Config& config) noexcept : script_(script), pace_(config) {}
  Playback(const Playback&) = delete;
  Playback& operator=(const Playback&) = delete;
  ~Playback() { stop(); }

  /// Starts the time-shared thread "rtpm-play", paused.
  /// @errors   no thread left
  [[nodiscard]] expected<void, SetupError> start();
  /// Ends the thread, once the script has returned. May be called again.
  void stop() noexcept;

  /// Plays from the current position, or from the beginning if it is at the end.
  void play(double speed);
  void pause();
  void seek(Duration at);

  struct Status {
    Pace::Position position{};
    double speed = 1;
    bool is_playing = false;  ///< Not paused, and messages remain.
    std::string problem{};    ///< Why the script ended early; otherwise empty.
  };
  [[nodiscard]] Status status() const;
  [[nodiscard]] Pace& pace() noexcept { return pace_; }

 private:
  friend class Turn;
  void run();
  void play_on(const Turn& turn, Duration from);
  /// Records how the script ended, unless another command arrived.
  void end(const Turn& turn, const expected<void, SetupError>& outcome);
  void begin_turn();
  void go_to(Duration at);
  /// The position from which a steady pace continues. Late messages count as not yet played, even
  /// if the pace has passed them. When looping, late messages are skipped.
  [[nodiscard]] Pace::Position place(MonotonicTime now) const noexcept;

  Script& script_;
  Pace pace_;
  mutable rt::PiMutex mutex_{};
  // Guarded by the mutex, like changes of the pace.
  double speed_ = 1;
  bool is_playing_ = false;
  std::optional<Duration> sought_{};
  Duration next_{0};  ///< The position of the message that the script plays or waits for.
  std::string problem_{};
  std::atomic<std::uint64_t> turn_{0};  ///< Counts commands.
  std::atomic<bool> is_stopping_{false};
  rt::Semaphore wake_{};
  rt::Thread thread_{};
};

}  // namespace rtpm::replay
