#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_serial/board.hpp"
#include "rtpm/device_serial/frames.hpp"
#include "rtpm/device_serial/transport.hpp"

namespace rtpm::device_serial {

/// The request of one cycle to the board, within its ranges.
/// @ownership plain value, trivially copyable
struct Request {
  std::uint64_t number = 0;  ///< Differs in each cycle.
  bool is_on = false;
  Duration time_left{0};  ///< How long it may stay in force.
  std::array<float, driver::kJointCountMax> efforts{};
  std::array<float, driver::kOutputCountMax> outputs{};
};

/// Counters of faults on the line since greet().
struct LineCounters {
  /// Number of bytes outside frames, and of frames with invalid contents.
  std::uint64_t corrupt = 0;
  std::uint64_t lost = 0;        ///< Number of states that the board sent but that did not arrive.
  std::uint64_t duplicate = 0;   ///< Number of states that arrived again.
  std::uint64_t stale = 0;       ///< Number of states older than one that arrived earlier.
  std::uint64_t unanswered = 0;  ///< Number of commands whose answer did not arrive in time.
};

/// The newest state in the session.
/// @ownership plain value, trivially copyable
struct Report {
  BoardState state{};
  std::uint64_t state_count = 0;
  MonotonicTime received_at{};
  Duration board_time{0};  ///< Board time, unwrapped.
  /// Presses and releases in all states, including states replaced by newer ones.
  std::array<std::uint16_t, driver::kButtonCountMax> button_edges{};
  LineCounters counters{};
  bool is_late = false;
  bool is_gone = false;
};

/// Opening the port resets some boards; their boot loader then runs for up to 2 s.
inline constexpr Duration kGreetingMax = std::chrono::seconds{5};

/// A nonce that distinguishes the session that starts at `now` from others; not zero.
[[nodiscard]] constexpr std::uint32_t nonce_at(MonotonicTime now) noexcept {
  return static_cast<std::uint32_t>(to_ns(now) >> 10) | 1U;
}

struct SessionConfig {
  Duration period{};  ///< The period of the requests.
  std::int64_t speed_baud = 115'200;
  std::uint32_t nonce = 1;  ///< Created by nonce_at(); not zero.
  Duration greeting_max = kGreetingMax;
};

/// The conversation with one board: greets it, sends each request as a command, and keeps the
/// newest state. At most kWindow commands are unanswered, so that a slow line never fills up. A
/// request that is not renewed expires, both on the host and through the board's watchdog. The
/// transport provides the time.
/// @ownership refers to its transport, which must outlive it
/// @threads  one at a time
class Session {
 public:
  static constexpr Duration kHelloEvery = std::chrono::milliseconds{250};
  static constexpr std::uint16_t kWindow = 2;
  /// The longest time for which a request stays in force.
  static constexpr Duration kRequestMax = std::chrono::milliseconds{100};
  /// Silence after which the board counts as gone, on a fast line.
  static constexpr Duration kGoneAfter = std::chrono::milliseconds{500};
  static constexpr Duration kStopMax = std::chrono::milliseconds{100};

  Session(Transport& transport, const SessionConfig& config);

  /// Asks the board for its description, repeatedly until the greeting times out. The board's
  /// efforts are zero meanwhile.
  /// @realtime set-up only
  /// @errors   silence, other bytes, another version, an impossible description; described in words
  [[nodiscard]] expected<BoardDescription, SetupError> greet();
  /// Starts measuring whether the board is late or gone. Call it after greet().
  void begin();
  /// Sends pending frames and reads what has arrived; waits for at most `patience`.
  /// @return false if the board is gone
  /// @realtime alloc-free
  [[nodiscard]] bool step(const Request& request, Duration patience);
  /// Switches the board off and waits for its confirmation, at most kStopMax longer than for an
  /// answer. Has no effect before begin().
  void stop();

  [[nodiscard]] Report report() const;

 private:
  void transfer(const Request& request, Duration patience);
  void close() noexcept;
  [[nodiscard]] bool send_frame(FrameType type, ConstBytes payload);
  [[nodiscard]] bool flush();
  [[nodiscard]] bool send_due(const Request& request, MonotonicTime now);
  [[nodiscard]] bool send_command(const Request& request, MonotonicTime now);
  void take(const expected<Frame, FrameFault>& frame);
  void take_state(const Frame& frame);
  void accept(const BoardState& state);
  void take_description(const Frame& frame);
  [[nodiscard]] SetupError greeting_error() const;
  [[nodiscard]] std::uint16_t unanswered() const noexcept;

  Transport& transport_;
  SessionConfig config_;
  FrameCutter cutter_{};
  BoardShape shape_{};
  Duration answer_max_{};
  Duration late_after_{};
  Duration gone_after_{};

  // Used only by greet().
  std::optional<expected<BoardDescription, std::string>> description_{};
  bool is_greeting_ = true;
  bool has_started_again_ = false;  ///< The board reported that it restarted.
  bool has_other_version_ = false;
  std::uint64_t byte_count_ = 0;

  /// The bytes of one frame that the port has not accepted yet.
  std::array<std::byte, kWireSizeMax> unsent_{};
  std::size_t unsent_begin_ = 0;
  std::size_t unsent_end_ = 0;

  std::uint16_t sent_sequence_ = 0;
  std::uint64_t sent_count_ = 0;
  std::uint16_t answered_sequence_ = 0;
  MonotonicTime sent_at_{};
  std::uint64_t request_number_ = 0;
  MonotonicTime request_end_{};
  bool is_request_new_ = false;

  std::uint16_t board_sequence_ = 0;
  Report report_{};
  MonotonicTime stepped_at_{};
  Duration silence_{};  ///< How long nothing was received.
  bool has_accepted_ = false;
  bool is_closed_ = false;  ///< The port is closed.
  bool is_gone_ = false;    ///< The board is gone.
};

}  // namespace rtpm::device_serial
