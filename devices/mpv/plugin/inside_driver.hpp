#pragma once

#include <mpv/client.h>

#include <atomic>
#include <optional>
#include <string>

#include "rtpm/base/latest.hpp"
#include "rtpm/device_mpv/player.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::mpv_plugin {

/// The values exchanged between the device's thread and the plug-in's thread; only the latter calls
/// mpv.
/// @threads  each side: one thread
/// @realtime wait-free
struct Exchange {
  Latest<device_mpv::PlayerState> state{};      ///< Written by the plug-in's thread.
  Latest<device_mpv::PlayerRequest> request{};  ///< Written by the device's thread.
  std::atomic<bool> is_over{false};             ///< mpv is exiting.
};

/// The surrounding player as a driver.
/// @ownership refers to the exchange, which must outlive it
class InsideDriver final : public driver::Driver {
 public:
  InsideDriver(Exchange& exchange, std::string serial, std::string frame)
      : exchange_(exchange), serial_(std::move(serial)), frame_(std::move(frame)) {}
  [[nodiscard]] driver::Descriptor describe() const override {
    return device_mpv::player_descriptor(serial_, frame_);
  }
  [[nodiscard]] expected<void, SetupError> configure(const driver::DriverConfig& config) override;
  [[nodiscard]] expected<void, SetupError> activate() override;
  [[nodiscard]] driver::ExchangeStatus exchange(const driver::Command& command,
                                                driver::Sample& sample) noexcept override;
  void deactivate() noexcept override { is_active_ = false; }

 private:
  Exchange& exchange_;
  std::string serial_;
  std::string frame_;
  bool is_active_ = false;
};

/// The plug-in thread's access to mpv: sends changes and reads the state.
/// @threads  the plug-in's thread
/// @realtime set-up only
class Player {
 public:
  explicit Player(mpv_handle* handle) noexcept : handle_(handle) {}
  void apply(const device_mpv::PlayerRequest& request);
  [[nodiscard]] const device_mpv::PlayerState& look();

 private:
  [[nodiscard]] double number(const char* property, double otherwise) const;
  [[nodiscard]] bool flag(const char* property, bool otherwise) const;
  void seek(double position_s);
  void set_rate(float rate);

  mpv_handle* handle_;
  device_mpv::PlayerState state_{};
  std::optional<float> sent_rate_{};
  float sent_seek_s_ = -1;
  bool is_backwards_ = false;
};

}  // namespace rtpm::mpv_plugin
