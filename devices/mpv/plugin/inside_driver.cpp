#include "inside_driver.hpp"

#include <array>
#include <cmath>

namespace rtpm::mpv_plugin {

expected<void, SetupError> InsideDriver::configure(const driver::DriverConfig& config) {
  if (config.period > Duration{0}) return {};
  return setup_error("the player's driver needs a period above zero");
}

expected<void, SetupError> InsideDriver::activate() {
  is_active_ = true;
  return {};
}

driver::ExchangeStatus InsideDriver::exchange(const driver::Command& command,
                                              driver::Sample& sample) noexcept {
  if (!is_active_ || exchange_.is_over.load(std::memory_order_relaxed)) {
    return driver::ExchangeStatus::kGone;
  }
  const device_mpv::PlayerRequest request = device_mpv::request_of(command);
  exchange_.request.write(request);
  const auto state = exchange_.state.read();
  if (!state) return driver::ExchangeStatus::kLate;
  sample.host_time = command.cycle_time;
  device_mpv::fill(sample, *state, request);
  return driver::ExchangeStatus::kOk;
}

double Player::number(const char* property, double otherwise) const {
  double value = 0;
  const int fault = mpv_get_property(handle_, property, MPV_FORMAT_DOUBLE, &value);
  return fault == 0 ? value : otherwise;
}

bool Player::flag(const char* property, bool otherwise) const {
  int value = 0;
  const int fault = mpv_get_property(handle_, property, MPV_FORMAT_FLAG, &value);
  return fault == 0 ? value != 0 : otherwise;
}

const device_mpv::PlayerState& Player::look() {
  const double position_s = number("time-pos", state_.position_s);
  // During a seek, mpv reports the target as its position although it shows another frame.
  if (!flag("seeking", false)) state_.position_s = position_s;
  state_.duration_s = number("duration", 0);
  state_.speed = number("speed", 1);
  const double frames_per_s = number("container-fps", 0);
  state_.frame_s = frames_per_s > 0 ? 1 / frames_per_s : 0;
  state_.is_paused = flag("pause", true);
  state_.is_backwards = is_backwards_;
  ++state_.report_count;
  return state_;
}

void Player::apply(const device_mpv::PlayerRequest& request) {
  if (request.seek_s < 0) sent_seek_s_ = request.seek_s;
  if (request.seek_s != sent_seek_s_ && !flag("seeking", false)) {
    sent_seek_s_ = request.seek_s;
    seek(request.seek_s);
    // mpv pauses by itself at the end of the file, so the rate is sent again after a seek.
    sent_rate_.reset();
  }
  if (sent_rate_ == request.rate) return;
  sent_rate_ = request.rate;
  set_rate(request.rate);
}

void Player::seek(double position_s) {
  const std::string target = std::to_string(position_s);
  std::array<const char*, 4> words{"seek", target.c_str(), "absolute+exact", nullptr};
  static_cast<void>(mpv_command(handle_, words.data()));
}

void Player::set_rate(float rate) {
  int is_paused = rate == 0 ? 1 : 0;
  if (is_paused == 0) {
    const bool is_backwards = rate < 0;
    if (is_backwards != is_backwards_) {
      is_backwards_ = is_backwards;
      mpv_set_property_string(handle_, "play-dir", is_backwards ? "backward" : "forward");
    }
    double speed = std::abs(rate);
    mpv_set_property(handle_, "speed", MPV_FORMAT_DOUBLE, &speed);
  }
  mpv_set_property(handle_, "pause", MPV_FORMAT_FLAG, &is_paused);
}

}  // namespace rtpm::mpv_plugin
