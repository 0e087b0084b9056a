#include "rtpm/device_mpv/session.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace rtpm::device_mpv {
namespace {

constexpr float kNoSeek = -1;

}  // namespace

Session::Session(Transport& transport, Duration period)
    : transport_(transport),
      period_(period),
      next_round_(transport.now()),
      reported_at_(transport.now()) {}

bool Session::step(const std::optional<PlayerRequest>& request, Duration patience) {
  const MonotonicTime now = transport_.now();
  // A player that has just started may take longer.
  if (state_.report_count > 0 && now - reported_at_ > kGoneAfter) return false;
  if (request && !send_changes(*request, now)) return false;
  if (!ask(now)) return false;
  std::array<char, 4096> buffer{};
  const Received received = transport_.receive(buffer, patience);
  cutter_.push({buffer.data(), received.size},
               [this](std::string_view line) { take(parse(line)); });
  if (round_id_ != 0 &&
      std::ranges::all_of(answers_, [](const auto& a) { return a.has_value(); })) {
    finish(transport_.now());
  }
  return !received.is_closed;
}

bool Session::send(std::string_view name, std::initializer_list<Word> arguments) {
  return transport_.send(command_line(++last_id_, name, arguments));
}

/// Only one round at a time: a player that does not answer is not asked again.
bool Session::ask(MonotonicTime now) {
  if (round_id_ != 0 || now < next_round_) return true;
  next_round_ = std::max(next_round_ + period_, now);
  answers_.fill(std::nullopt);
  round_id_ = last_id_ + 1;
  static constexpr std::array<const char*, kQuestionCount> kNames{
      "time-pos", "duration", "speed", "container-fps", "pause", "seeking"};
  return std::ranges::all_of(kNames,
                             [this](const char* name) { return send("get_property", {name}); });
}

bool Session::send_changes(const PlayerRequest& request, MonotonicTime now) {
  if (request.seek_s < 0) sent_seek_s_ = request.seek_s;
  const bool is_seeking = seeking_since_ && now - *seeking_since_ < kSeekMax;
  if (request.seek_s != sent_seek_s_ && !is_seeking) {
    sent_seek_s_ = request.seek_s;
    seeking_since_ = now;
    if (!send("seek", {static_cast<double>(request.seek_s), "absolute+exact"})) return false;
    seek_id_ = last_id_;
    // mpv pauses by itself at the end of the file, so the rate is sent again after a seek.
    sent_rate_.reset();
  }
  if (sent_rate_ == request.rate) return true;
  sent_rate_ = request.rate;
  return send_rate(request.rate);
}

bool Session::send_rate(float rate) {
  if (rate == 0) return send("set_property", {"pause", true});
  // Setting the direction causes a seek, so it is set only when it changes.
  const bool is_backwards = rate < 0;
  if (sent_backwards_ != is_backwards) {
    sent_backwards_ = is_backwards;
    if (!send("set_property", {"play-dir", is_backwards ? "backward" : "forward"})) return false;
  }
  return send("set_property", {"speed", static_cast<double>(std::abs(rate))}) &&
         send("set_property", {"pause", false});
}

void Session::take(const Message& message) {
  if (std::holds_alternative<Unreadable>(message)) ++unreadable_count_;
  const auto* const reply = std::get_if<Reply>(&message);
  if (reply == nullptr) return;
  // A player that is still loading its file refuses to seek; the next round sends the seek again.
  if (reply->request_id == seek_id_ && !reply->is_success) sent_seek_s_ = kNoSeek;
  if (round_id_ == 0) return;
  // Unsigned, so that a foreign number below the round's first is also above every question.
  const auto question =
      static_cast<std::uint64_t>(reply->request_id) - static_cast<std::uint64_t>(round_id_);
  if (question < kQuestionCount) answers_[question] = *reply;
}

void Session::finish(MonotonicTime now) {
  const auto number = [this](Question question, double otherwise) {
    return answers_[question]->is_success ? answers_[question]->number.value_or(otherwise)
                                          : otherwise;
  };
  const bool is_seeking = answers_[kSeeking]->flag.value_or(false);
  // During a seek, mpv reports the target as its position although it shows another frame.
  if (!is_seeking) state_.position_s = number(kPosition, state_.position_s);
  state_.duration_s = number(kDuration, 0);
  state_.speed = number(kSpeed, 1);
  const double frames_per_s = number(kFrameRate, 0);
  state_.frame_s = frames_per_s > 0 ? 1 / frames_per_s : 0;
  state_.is_paused = answers_[kPause]->flag.value_or(true);
  state_.is_backwards = sent_backwards_.value_or(false);
  ++state_.report_count;
  if (!is_seeking && round_id_ > seek_id_) seeking_since_.reset();
  reported_at_ = now;
  round_id_ = 0;
}

}  // namespace rtpm::device_mpv
