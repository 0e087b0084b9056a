#pragma once

#include <array>

#include "hid_model.hpp"

namespace rtpm::test {

/// OpenFFBoard with one axis: a wheel that its operator turns, and a motor with the torque of the
/// running constant-force effects.
class OpenFfBoardModel final : public PeriodicHidModel {
 public:
  static constexpr std::int64_t kRangeDegrees = 900;
  OpenFfBoardModel() : PeriodicHidModel(std::chrono::milliseconds{1}) {}
  [[nodiscard]] HidIdentity identity() const override;
  [[nodiscard]] HidReport report_descriptor() const override;
  bool write(const HidReport& report) override;
  [[nodiscard]] bool is_safe() const override { return torque_share() == 0; }
  void press(int button, bool is_pressed) override;
  /// Axis 0 is the wheel: ±1 are the ends of its range.
  void move(int axis, double share) override;

  /// The torque as a share of the motor's greatest: -1 to 1.
  [[nodiscard]] double torque_share() const;
  [[nodiscard]] int effect_count() const;

 private:
  void send_period() override;
  void answer(const HidReport& command, std::uint8_t type, std::int64_t value);
  void take_effect_command(const HidReport& report, std::uint8_t type, std::uint32_t number);

  struct Effect {
    bool is_made = false;
    bool is_running = false;
    std::int16_t magnitude = 0;
  };
  std::array<Effect, 40> effects_{};
  bool is_active_ = false;
  std::array<std::int16_t, 8> axes_{};
  std::uint64_t buttons_ = 0;
};

}  // namespace rtpm::test
