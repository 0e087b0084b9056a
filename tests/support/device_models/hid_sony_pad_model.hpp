#pragma once

#include <array>

#include "hid_model.hpp"

namespace rtpm::test {

/// The common part of DualShock 4 and DualSense: a report every 4 ms, checksums over Bluetooth,
/// where only the minimal report comes until the calibration is read.
class SonyPadModel : public PeriodicHidModel {
 public:
  SonyPadModel(bool is_bluetooth, std::uint8_t bluetooth_id)
      : PeriodicHidModel(std::chrono::milliseconds{4}),
        is_bluetooth_(is_bluetooth),
        bluetooth_id_(bluetooth_id) {}
  [[nodiscard]] HidReport report_descriptor() const override;
  [[nodiscard]] HidReport read_feature(std::uint8_t id) override;
  [[nodiscard]] bool is_safe() const override { return outputs_ == decltype(outputs_){}; }
  void press(int button, bool is_pressed) override;
  /// Left x, left y, right x, right y, and from -1 at rest the left and the right trigger.
  void move(int axis, double share) override;

  enum Output : std::uint8_t { kStrong, kWeak, kRed, kGreen, kBlue };
  [[nodiscard]] std::uint8_t output(Output output) const { return outputs_[output]; }

 protected:
  void send_period() override;
  /// Fills the block that USB and Bluetooth reports share.
  virtual void fill(HidReport& report, std::size_t at) const = 0;
  [[nodiscard]] bool is_checked(const HidReport& report) const;

  bool is_bluetooth_;
  std::uint8_t bluetooth_id_;
  bool is_full_ = false;
  std::array<std::uint8_t, 6> axes_{128, 128, 128, 128, 0, 0};
  std::uint32_t buttons_ = 0;
  std::uint32_t sent_count_ = 0;
  std::array<std::uint8_t, 5> outputs_{};
};

class DualShock4Model final : public SonyPadModel {
 public:
  explicit DualShock4Model(bool is_bluetooth) : SonyPadModel(is_bluetooth, 0x11) {}
  [[nodiscard]] HidIdentity identity() const override;
  bool write(const HidReport& report) override;

 private:
  void fill(HidReport& report, std::size_t at) const override;
};

class DualSenseModel final : public SonyPadModel {
 public:
  explicit DualSenseModel(bool is_bluetooth) : SonyPadModel(is_bluetooth, 0x31) {}
  [[nodiscard]] HidIdentity identity() const override;
  bool write(const HidReport& report) override;

 private:
  void fill(HidReport& report, std::size_t at) const override;
};

}  // namespace rtpm::test
