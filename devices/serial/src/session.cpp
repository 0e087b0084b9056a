#include "rtpm/device_serial/session.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/device_io/buttons.hpp"

namespace rtpm::device_serial {

using std::chrono::milliseconds;

namespace {

constexpr int kBitsPerByte = 10;  ///< On the line, including start and stop bits.

Duration time_on_line(std::size_t byte_count, std::int64_t speed_baud) {
  const auto bits = static_cast<std::int64_t>(byte_count) * kBitsPerByte;
  return Duration{bits * 1'000'000'000 / std::max<std::int64_t>(speed_baud, 1)};
}

/// How much newer `sequence` is than `last`: 0 means equal, more than 0x7fff means older.
std::uint16_t step_from(std::uint16_t last, std::uint16_t sequence) noexcept {
  return static_cast<std::uint16_t>(sequence - last);
}

constexpr std::uint16_t kStepMax = 0x7fff;

/// Silence while this host was not running proves nothing about the board.
constexpr Duration kListenMax = milliseconds{50};

}  // namespace

Session::Session(Transport& transport, const SessionConfig& config)
    : transport_(transport), config_(config) {}

expected<BoardDescription, SetupError> Session::greet() {
  const MonotonicTime end = transport_.now() + config_.greeting_max;
  MonotonicTime next_hello = transport_.now();
  std::array<std::byte, 4> nonce{};
  store_le(nonce.data(), config_.nonce);
  while (!description_ && !is_closed_ && transport_.now() < end) {
    const bool is_due = transport_.now() >= next_hello || has_started_again_;
    if (is_due && unsent_begin_ == unsent_end_) {
      has_started_again_ = false;
      next_hello = transport_.now() + kHelloEvery;
      if (!send_frame(FrameType::kHello, nonce)) close();
    }
    transfer({}, milliseconds{10});
  }
  if (!description_) return unexpected{greeting_error()};
  if (!*description_)
    return setup_error("the board's description is wrong", description_->error(),
                       "correct its firmware, see devices/serial/FRAMES.md");
  shape_ = (*description_)->shape();
  return **description_;
}

SetupError Session::greeting_error() const {
  if (is_closed_) return {"the port closed", "the board was unplugged", "plug it in, and leave it"};
  if (has_other_version_)
    return {"the board speaks another version of the frames",
            "this driver speaks version " + std::to_string(kFramesVersion),
            "load firmware of that version"};
  if (byte_count_ > 0)
    return {"the board sends bytes, but no description", "its speed or firmware is another one",
            "give 'speed=' as in the board's firmware, or load devices/serial/firmware"};
  return {"the board does not answer", "it sent nothing",
          "see whether this is its port, and whether its firmware is RTPM's"};
}

void Session::begin() {
  is_greeting_ = false;
  const Duration line = time_on_line(exchange_size(shape_), config_.speed_baud);
  answer_max_ = milliseconds{10} + 4 * line;
  late_after_ = 3 * config_.period + milliseconds{5} + 2 * line;
  gone_after_ = std::max(kGoneAfter, 4 * answer_max_);
  report_ = {};
  report_.received_at = transport_.now();
  stepped_at_ = transport_.now();
  silence_ = {};
  request_number_ = 0;
  request_end_ = transport_.now();
  sent_at_ = transport_.now() - config_.period * 2;
  answered_sequence_ = sent_sequence_;
  sent_count_ = 0;
}

bool Session::step(const Request& request, Duration patience) {
  if (!is_gone_) transfer(request, patience);
  const MonotonicTime now = transport_.now();
  const Duration listened = std::min(now - std::exchange(stepped_at_, now), kListenMax);
  silence_ = has_accepted_ ? Duration{0} : silence_ + listened;
  has_accepted_ = false;
  if (silence_ > gone_after_) is_gone_ = true;
  return !is_gone_;
}

void Session::transfer(const Request& request, Duration patience) {
  if (!flush() || (!is_greeting_ && !send_due(request, transport_.now()))) close();
  std::array<std::byte, 512> buffer;
  const Transferred received = transport_.receive(buffer, patience);
  byte_count_ += received.size;
  cutter_.push(ConstBytes(buffer).first(received.size),
               [this](const expected<Frame, FrameFault>& frame) { take(frame); });
  if (received.is_closed) close();
}

void Session::close() noexcept {
  is_closed_ = true;
  is_gone_ = true;
}

bool Session::flush() {
  const ConstBytes rest = ConstBytes(unsent_).subspan(unsent_begin_, unsent_end_ - unsent_begin_);
  if (rest.empty()) return true;
  const Transferred sent = transport_.send(rest);
  unsent_begin_ += std::min(sent.size, rest.size());
  return !sent.is_closed;
}

/// Call this only when all bytes of the previous frame have been sent.
bool Session::send_frame(FrameType type, ConstBytes payload) {
  unsent_begin_ = 0;
  unsent_end_ = encode({type, ++sent_sequence_, payload}, unsent_);
  return flush();
}

std::uint16_t Session::unanswered() const noexcept {
  return step_from(answered_sequence_, sent_sequence_);
}

bool Session::send_due(const Request& request, MonotonicTime now) {
  if (std::exchange(request_number_, request.number) != request.number) {
    request_end_ = now + std::clamp(request.time_left, Duration{0}, kRequestMax);
    is_request_new_ = true;
  }
  if (unsent_begin_ != unsent_end_) return true;
  if (unanswered() > 0 && now - sent_at_ > answer_max_) {
    report_.counters.unanswered += unanswered();
    answered_sequence_ = sent_sequence_;
  }
  // Without new requests, it polls for states at a lower rate that is not synchronized with the
  // requests.
  const bool is_due = is_request_new_ || now - sent_at_ >= config_.period * 3 / 2;
  if (!is_due || unanswered() >= kWindow) return true;
  return send_command(request, now);
}

bool Session::send_command(const Request& request, MonotonicTime now) {
  const auto left_ms = std::chrono::duration_cast<milliseconds>(request_end_ - now).count();
  BoardCommand command;
  command.is_on = request.is_on && request_end_ > now;
  command.watchdog_ms = static_cast<std::uint16_t>(std::clamp<std::int64_t>(left_ms, 1, 1000));
  command.efforts = request.efforts;
  command.outputs = request.outputs;
  std::array<std::byte, kCommandSizeMax> payload{};
  const std::size_t size = write_command(command, shape_, payload);
  is_request_new_ = false;
  sent_at_ = now;
  ++sent_count_;
  return send_frame(FrameType::kCommand, ConstBytes(payload).first(size));
}

void Session::take(const expected<Frame, FrameFault>& frame) {
  if (!frame) {
    has_other_version_ = has_other_version_ || frame.error() == FrameFault::kVersion;
    ++report_.counters.corrupt;
  } else if (frame->type == FrameType::kDescription) {
    take_description(*frame);
  } else if (frame->type == FrameType::kState && !is_greeting_) {
    take_state(*frame);
  }
}

void Session::take_description(const Frame& frame) {
  if (frame.payload.size() < 4) {
    ++report_.counters.corrupt;
    return;
  }
  const auto nonce = load_le<std::uint32_t>(frame.payload.data());
  if (!is_greeting_) {
    // A restarted board has lost the session and the positions of its encoders.
    is_gone_ = is_gone_ || nonce != config_.nonce;
    return;
  }
  has_started_again_ = nonce == 0;
  if (nonce != config_.nonce) return;
  board_sequence_ = frame.sequence;
  description_ = parse_description(frame.payload);
}

void Session::take_state(const Frame& frame) {
  const auto state = parse_state(frame.payload, shape_);
  if (!state) {
    ++report_.counters.corrupt;
    return;
  }
  const std::uint16_t step = step_from(board_sequence_, frame.sequence);
  const bool answers_ours = step_from(state->answered, sent_sequence_) < sent_count_;
  if (step == 0) {
    ++report_.counters.duplicate;
  } else if (step > kStepMax || !answers_ours) {
    ++report_.counters.stale;
  } else {
    report_.counters.lost += step - 1U;
    board_sequence_ = frame.sequence;
    accept(*state);
  }
}

void Session::accept(const BoardState& state) {
  if (report_.state_count > 0) {
    report_.board_time += std::chrono::microseconds{state.time_us - report_.state.time_us};
    device_io::count_edges(report_.state.buttons, state.buttons, report_.button_edges);
  } else {
    report_.board_time = std::chrono::microseconds{state.time_us};
  }
  if (step_from(answered_sequence_, state.answered) <= unanswered())
    answered_sequence_ = state.answered;
  report_.state = state;
  ++report_.state_count;
  report_.received_at = transport_.now();
  has_accepted_ = true;
}

void Session::stop() {
  if (is_greeting_) return;
  const MonotonicTime end = transport_.now() + kStopMax + answer_max_;
  const Request off{.number = request_number_ + 1};
  const auto first_off = static_cast<std::uint16_t>(sent_sequence_ + 1);
  // Also sent to a board that counts as gone, because perhaps only its answers are lost.
  while (!is_closed_ && transport_.now() < end) {
    transfer(off, milliseconds{1});
    const bool is_confirmed =
        report_.state_count > 0 && step_from(first_off, report_.state.answered) <= kStepMax;
    if (is_confirmed) return;
  }
}

Report Session::report() const {
  Report report = report_;
  report.is_late = transport_.now() - report_.received_at > late_after_;
  report.is_gone = is_gone_;
  return report;
}

}  // namespace rtpm::device_serial
