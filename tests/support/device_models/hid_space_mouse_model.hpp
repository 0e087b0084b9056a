#pragma once

#include <array>

#include "hid_model.hpp"

namespace rtpm::test {

/// A 3Dconnexion device: silent at rest; while the cap is moved a report every 8 ms.
class SpaceMouseModel final : public PeriodicHidModel {
 public:
  enum class Layout : std::uint8_t {
    kTwoReports,  ///< SpaceNavigator: translation and rotation in turn, axes flagged as relative.
    kOneReport,   ///< SpaceMouse Wireless: all six axes in one report.
  };
  explicit SpaceMouseModel(Layout layout);

  [[nodiscard]] HidIdentity identity() const override;
  [[nodiscard]] HidReport report_descriptor() const override;
  bool write(const HidReport& report) override;
  [[nodiscard]] bool is_safe() const override { return !is_lit_; }
  void press(int button, bool is_pressed) override;
  /// Axes X, Y, Z, Rx, Ry, Rz of the device's own frame: right, to the user, down.
  void move(int axis, double share) override;

 private:
  void send_period() override;
  [[nodiscard]] HidReport axes_report(std::uint8_t id, std::size_t first, std::size_t count) const;

  Layout layout_;
  std::array<std::int16_t, 6> counts_{};
  std::uint8_t buttons_ = 0;
  bool is_lit_ = false;
  bool is_rotation_next_ = false;
  int reports_left_ = 0;
};

}  // namespace rtpm::test
