#pragma once

#include <array>

#include "hid_model.hpp"

namespace rtpm::test {

/// A plain game pad without report numbers: four axes of 8 bits, a hat with a null state, twelve
/// buttons. It reports only what changes.
class GamePadModel final : public HidModel {
 public:
  [[nodiscard]] HidIdentity identity() const override;
  [[nodiscard]] HidReport report_descriptor() const override;
  void advance(std::chrono::nanoseconds) override {}
  bool write(const HidReport&) override { return false; }
  [[nodiscard]] bool is_safe() const override { return true; }
  void press(int button, bool is_pressed) override;
  void move(int axis, double share) override;
  /// @param direction  0 to 7, clockwise; 0 points away from the user; 15 is the centre
  void set_hat(std::uint8_t direction);

 private:
  void send();

  std::array<std::uint8_t, 4> axes_{128, 128, 128, 128};
  std::uint8_t hat_ = 15;
  std::uint16_t buttons_ = 0;
};

}  // namespace rtpm::test
