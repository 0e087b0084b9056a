#include "hid_sony_pad_model.hpp"

#include <algorithm>
#include <cmath>

namespace rtpm::test {
namespace {

constexpr std::size_t kBluetoothSize = 78;

std::uint32_t crc32(std::uint8_t seed, const HidReport& report, std::size_t size) {
  std::uint32_t crc = 0xffffffff;
  for (std::size_t i = 0; i <= size; ++i) {
    crc ^= i == 0 ? seed : report[i - 1];
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc & 1) != 0 ? (crc >> 1) ^ 0xedb88320 : crc >> 1;
  }
  return ~crc;
}

void add_checksum(std::uint8_t seed, HidReport& report) {
  put_le(report, report.size() - 4, crc32(seed, report, report.size() - 4), 4);
}

struct FeatureSize {
  std::uint8_t id;
  std::size_t size;
};
// The features that Linux's own driver reads when it binds: calibration, pairing, firmware.
constexpr std::array kFeatures{FeatureSize{0x02, 37}, FeatureSize{0x05, 41}, FeatureSize{0x09, 20},
                               FeatureSize{0x12, 16}, FeatureSize{0x20, 64}, FeatureSize{0xa3, 49}};

void add_report(HidReport& descriptor, std::uint8_t id, std::uint8_t main, std::size_t size) {
  const HidReport items{0x85, id,  0x09, id, 0x75, 0x08, 0x95, static_cast<std::uint8_t>(size - 1),
                        main, 0x02};
  descriptor.insert(descriptor.end(), items.begin(), items.end());
}

}  // namespace

/// The reports have the device's sizes; their contents are vendor-defined here.
HidReport SonyPadModel::report_descriptor() const {
  constexpr std::uint8_t kInput = 0x81;
  constexpr std::uint8_t kOutput = 0x91;
  constexpr std::uint8_t kFeature = 0xb1;
  const bool is_dualsense = bluetooth_id_ == 0x31;
  HidReport descriptor{0x05, 0x01, 0x09, 0x05, 0xa1, 0x01, 0x06,
                       0x00, 0xff, 0x15, 0x00, 0x26, 0xff, 0x00};
  if (is_bluetooth_) {
    add_report(descriptor, 0x01, kInput, 10);
    add_report(descriptor, bluetooth_id_, kInput, kBluetoothSize);
    add_report(descriptor, bluetooth_id_, kOutput, kBluetoothSize);
  } else {
    add_report(descriptor, 0x01, kInput, 64);
    add_report(descriptor, is_dualsense ? 0x02 : 0x05, kOutput, is_dualsense ? 63 : 32);
  }
  for (const FeatureSize& feature : kFeatures) {
    if (!is_dualsense || feature.id != 0x02) {
      add_report(descriptor, feature.id, kFeature, feature.size);
    }
  }
  descriptor.push_back(0xc0);
  return descriptor;
}

HidReport SonyPadModel::read_feature(std::uint8_t id) {
  const auto* const feature = std::ranges::find(kFeatures, id, &FeatureSize::id);
  if (feature == kFeatures.end()) return {};
  HidReport report(feature->size, 1);
  report[0] = id;
  if (is_bluetooth_) add_checksum(0xa3, report);
  is_full_ = true;
  return report;
}

void SonyPadModel::press(int button, bool is_pressed) {
  const std::uint32_t bit = 1U << button;
  buttons_ = is_pressed ? buttons_ | bit : buttons_ & ~bit;
}

void SonyPadModel::move(int axis, double share) {
  axes_[static_cast<std::size_t>(axis)] =
      static_cast<std::uint8_t>(std::lround(127.5 * (share + 1)));
}

void SonyPadModel::send_period() {
  ++sent_count_;
  if (!is_bluetooth_) {
    HidReport report(64);
    report[0] = 0x01;
    fill(report, 1);
    queue(report);
  } else if (is_full_) {
    HidReport report(kBluetoothSize);
    report[0] = bluetooth_id_;
    fill(report, bluetooth_id_ == 0x31 ? 2 : 3);
    add_checksum(0xa1, report);
    queue(report);
  } else {
    HidReport report(10, 0x80);
    report[0] = 0x01;
    queue(report);
  }
}

bool SonyPadModel::is_checked(const HidReport& report) const {
  return report.size() == kBluetoothSize && report[0] == bluetooth_id_ &&
         get_le(report, kBluetoothSize - 4, 4) == crc32(0xa2, report, kBluetoothSize - 4);
}

HidIdentity DualShock4Model::identity() const {
  return {0x054c, 0x09cc, is_bluetooth_, "Wireless Controller"};
}

void DualShock4Model::fill(HidReport& report, std::size_t at) const {
  for (std::size_t i = 0; i < 4; ++i)
    report[at + i] = axes_[i];
  report[at + 4] = static_cast<std::uint8_t>(8 | (buttons_ & 0xf) << 4);
  report[at + 5] = static_cast<std::uint8_t>(buttons_ >> 4);
  report[at + 6] = static_cast<std::uint8_t>((buttons_ >> 12 & 0x3) | sent_count_ << 2);
  report[at + 7] = axes_[4];
  report[at + 8] = axes_[5];
  put_le(report, at + 9, sent_count_ * 750, 2);  // 4 ms in units of 16/3 us.
}

bool DualShock4Model::write(const HidReport& report) {
  if (is_bluetooth_ ? !is_checked(report) : report.size() != 32 || report[0] != 0x05) return false;
  const std::size_t at = is_bluetooth_ ? 3 : 1;
  if (is_bluetooth_ && (report[1] & 0xc0) != 0xc0) return false;
  if ((report[at] & 0x01) != 0) {
    outputs_[kWeak] = report[at + 3];
    outputs_[kStrong] = report[at + 4];
  }
  if ((report[at] & 0x02) != 0)
    std::copy_n(report.begin() + static_cast<int>(at) + 5, 3, &outputs_[kRed]);
  return true;
}

HidIdentity DualSenseModel::identity() const {
  return {0x054c, 0x0ce6, is_bluetooth_, "DualSense Wireless Controller"};
}

void DualSenseModel::fill(HidReport& report, std::size_t at) const {
  for (std::size_t i = 0; i < 6; ++i)
    report[at + i] = axes_[i];
  report[at + 6] = static_cast<std::uint8_t>(sent_count_);
  report[at + 7] = static_cast<std::uint8_t>(8 | (buttons_ & 0xf) << 4);
  report[at + 8] = static_cast<std::uint8_t>(buttons_ >> 4);
  report[at + 9] = static_cast<std::uint8_t>(buttons_ >> 12 & 0x7);
  put_le(report, at + 27, sent_count_ * 12'000, 4);  // 4 ms in units of 1/3 us.
}

bool DualSenseModel::write(const HidReport& report) {
  if (is_bluetooth_ ? !is_checked(report) : report.size() != 63 || report[0] != 0x02) return false;
  const std::size_t at = is_bluetooth_ ? 3 : 1;
  if (is_bluetooth_ && report[2] != 0x10) return false;
  if ((report[at] & 0x03) == 0x03) {
    outputs_[kWeak] = report[at + 2];
    outputs_[kStrong] = report[at + 3];
  }
  if ((report[at + 1] & 0x04) != 0)
    std::copy_n(report.begin() + static_cast<int>(at) + 44, 3, &outputs_[kRed]);
  return true;
}

}  // namespace rtpm::test
