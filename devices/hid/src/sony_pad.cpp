#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>

#include "report.hpp"
#include "rtpm/base/hash.hpp"
#include "rtpm/device_hid/profiles.hpp"

namespace rtpm::device_hid {
namespace {

constexpr std::size_t kUsbSize = 64;
constexpr std::size_t kBluetoothSize = 78;
constexpr std::uint8_t kUsbReport = 0x01;

// On Bluetooth each report ends with a CRC-32 over the first byte of the transaction and the
// report.
constexpr std::byte kInputSeed{0xa1};
constexpr std::byte kOutputSeed{0xa2};
constexpr std::byte kFeatureSeed{0xa3};

/// The calibration report. Reading it makes a pad on Bluetooth send full reports from then on; the
/// driver needs only this side effect.
constexpr std::uint8_t kCalibrationReport = 0x05;
constexpr std::size_t kCalibrationSize = 41;

std::uint32_t checksum(std::byte seed, ConstBytes report) noexcept {
  return crc32(report, crc32({&seed, 1}));
}

bool has_checksum(std::byte seed, ConstBytes report) noexcept {
  if (report.size() < 5) return false;
  const std::size_t end = report.size() - 4;
  return checksum(seed, report.first(end)) == load_le<std::uint32_t>(report.data() + end);
}

float stick(std::uint8_t value) noexcept {
  return (static_cast<float>(value) - 127.5F) / 127.5F;
}
float trigger(std::uint8_t value) noexcept {
  return static_cast<float>(value) / 255;
}

/// Reads sticks, triggers and the hat, whose positions depend on the model.
void take_analogs(ConstBytes common, std::size_t triggers, std::uint8_t hat,
                  State& state) noexcept {
  for (std::size_t i = 0; i < 4; ++i)
    state.analogs[i] = stick(byte_at(common, i));
  for (std::size_t i = 0; i < 2; ++i)
    state.analogs[4 + i] = trigger(byte_at(common, triggers + i));
  // Clockwise, starting away from the user; 8 is the centre.
  constexpr std::array<float, 8> kX{0, 1, 1, 1, 0, -1, -1, -1};
  constexpr std::array<float, 8> kY{-1, -1, 0, 1, 1, 1, 0, -1};
  state.analogs[6] = hat < kX.size() ? kX[hat] : 0;
  state.analogs[7] = hat < kY.size() ? kY[hat] : 0;
}

std::byte to_byte(float share) noexcept {
  const float clamped = std::isfinite(share) ? std::clamp(share, 0.0F, 1.0F) : 0.0F;
  return static_cast<std::byte>(std::lround(255 * clamped));
}

void end_with_checksum(OutputReport& report) noexcept {
  const std::size_t end = report.size - 4;
  store_le<std::uint32_t>(report.bytes.data() + end,
                          checksum(kOutputSeed, ConstBytes(report.bytes).first(end)));
}

enum Output : std::uint8_t { kStrong, kWeak, kRed, kGreen, kBlue };

OutputReport dualshock4_report(Bus bus, const Request& request) noexcept {
  OutputReport report;
  std::size_t common = 1;
  report.size = 32;
  report.bytes[0] = std::byte{0x05};
  if (bus == Bus::kBluetooth) {
    common = 3;
    report.size = kBluetoothSize;
    report.bytes[0] = std::byte{0x11};
    report.bytes[1] = std::byte{0xc0};  // A HID report with a checksum.
  }
  const std::span<std::byte> to = std::span(report.bytes).subspan(common);
  to[0] = std::byte{0x03};  // Motors and light are valid.
  to[3] = to_byte(request.outputs[kWeak]);
  to[4] = to_byte(request.outputs[kStrong]);
  for (std::size_t i = 0; i < 3; ++i)
    to[5 + i] = to_byte(request.outputs[kRed + i]);
  if (bus == Bus::kBluetooth) end_with_checksum(report);
  return report;
}

OutputReport dualsense_report(Bus bus, std::uint8_t sequence, const Request& request) noexcept {
  OutputReport report;
  std::size_t common = 1;
  report.size = 63;
  report.bytes[0] = std::byte{0x02};
  if (bus == Bus::kBluetooth) {
    common = 3;
    report.size = kBluetoothSize;
    report.bytes[0] = std::byte{0x31};
    report.bytes[1] = static_cast<std::byte>(sequence << 4);
    report.bytes[2] = std::byte{0x10};
  }
  const std::span<std::byte> to = std::span(report.bytes).subspan(common);
  to[0] = std::byte{0x03};  // DualShock 4 vibration is valid and selected.
  to[1] = std::byte{0x04};  // The light bar is valid.
  to[2] = to_byte(request.outputs[kWeak]);
  to[3] = to_byte(request.outputs[kStrong]);
  for (std::size_t i = 0; i < 3; ++i)
    to[44 + i] = to_byte(request.outputs[kRed + i]);
  if (bus == Bus::kBluetooth) end_with_checksum(report);
  return report;
}

}  // namespace

driver::Descriptor SonyPad::describe() const {
  const bool is_dualsense = model_ == Model::kDualSense;
  driver::Descriptor descriptor;
  descriptor.device_class = driver::DeviceClass::kInput;
  descriptor.model = is_dualsense ? "Sony DualSense" : "Sony DualShock 4";
  descriptor.buttons = {"square", "cross", "circle",  "triangle", "l1", "r1",   "l2",
                        "r2",     "share", "options", "l3",       "r3", "home", "touchpad"};
  if (is_dualsense) {
    descriptor.buttons[8] = "create";
    descriptor.buttons.emplace_back("mute");
  }
  for (const char* name : {"left_x", "left_y", "right_x", "right_y", "left_trigger",
                           "right_trigger", "hat_x", "hat_y"}) {
    const bool is_trigger = std::string(name).ends_with("trigger");
    descriptor.analogs.push_back(
        {.name = name, .unit = "1", .low = is_trigger ? 0.0 : -1.0, .high = 1});
  }
  for (const char* name : {"rumble_strong", "rumble_weak", "red", "green", "blue"})
    descriptor.outputs.push_back({.name = name, .unit = "1"});
  descriptor.modes = {driver::CommandMode::kOutputs};
  descriptor.rate_hz = 250;
  return descriptor;
}

std::optional<Duration> SonyPad::silence_max() const {
  return std::chrono::milliseconds{100};
}

expected<void, SetupError> SonyPad::begin(HidTransport& transport, const Unit& unit) {
  bus_ = unit.bus;
  has_report_ = false;
  if (bus_ != Bus::kBluetooth) return {};
  constexpr int kAttemptCount = 3;  // The radio link loses some reports.
  for (int i = 0; i < kAttemptCount; ++i) {
    std::array<std::byte, kCalibrationSize> report{std::byte{kCalibrationReport}};
    if (transport.read_feature(report) == report.size() && has_checksum(kFeatureSeed, report)) {
      return {};
    }
  }
  return setup_error(unit.node + " does not answer", "its calibration can't be read",
                     "switch the pad off and on again");
}

/// Adds the time since the last report.
/// @return false if the pad repeats its counter and time, so the report has nothing new
bool SonyPad::advance(const Clock& clock, std::uint32_t counter, std::uint32_t ticks,
                      State& state) noexcept {
  if (has_report_) {
    if (counter == counter_ && ticks == ticks_) return false;
    const std::int64_t elapsed = (ticks - ticks_) & clock.mask;
    state.device_time += Duration{elapsed * clock.three_ticks_ns / 3};
  }
  has_report_ = true;
  counter_ = counter;
  ticks_ = ticks;
  return true;
}

Verdict SonyPad::take(ConstBytes report, MonotonicTime, State& state) noexcept {
  if (report.empty()) return Verdict::kCorrupt;
  const bool is_bluetooth = bus_ == Bus::kBluetooth;
  const bool is_dualsense = model_ == Model::kDualSense;
  const std::uint8_t bluetooth_id = is_dualsense ? 0x31 : 0x11;
  if (byte_at(report, 0) != (is_bluetooth ? bluetooth_id : kUsbReport)) return Verdict::kForeign;
  if (is_bluetooth) {
    if (report.size() != kBluetoothSize || !has_checksum(kInputSeed, report)) {
      return Verdict::kCorrupt;
    }
    const ConstBytes common = report.subspan(is_dualsense ? 2 : 3);
    return is_dualsense ? take_dualsense(common, state) : take_dualshock4(common, state);
  }
  if (!has_size(report, kUsbSize)) return Verdict::kCorrupt;
  const ConstBytes common = report.subspan(1);
  return is_dualsense ? take_dualsense(common, state) : take_dualshock4(common, state);
}

Verdict SonyPad::take_dualshock4(ConstBytes common, State& state) noexcept {
  const std::uint8_t last = byte_at(common, 6);
  const std::uint32_t ticks = load_le<std::uint16_t>(common.data() + 9);
  if (!advance({0xffff, 16'000}, last >> 2, ticks, state)) return Verdict::kStale;
  const std::uint8_t first = byte_at(common, 4);
  take_analogs(common, 7, first & 0xf, state);
  state.set_buttons(static_cast<std::uint32_t>(first >> 4) |
                    static_cast<std::uint32_t>(byte_at(common, 5)) << 4 |
                    static_cast<std::uint32_t>(last & 0x3) << 12);
  return Verdict::kNew;
}

Verdict SonyPad::take_dualsense(ConstBytes common, State& state) noexcept {
  const std::uint32_t ticks = load_le<std::uint32_t>(common.data() + 27);
  if (!advance({0xffffffff, 1000}, byte_at(common, 6), ticks, state)) return Verdict::kStale;
  const std::uint8_t first = byte_at(common, 7);
  take_analogs(common, 4, first & 0xf, state);
  state.set_buttons(static_cast<std::uint32_t>(first >> 4) |
                    static_cast<std::uint32_t>(byte_at(common, 8)) << 4 |
                    static_cast<std::uint32_t>(byte_at(common, 9) & 0x7) << 12);
  return Verdict::kNew;
}

OutputReport SonyPad::encode(const Request& request) noexcept {
  if (model_ == Model::kDualShock4) return dualshock4_report(bus_, request);
  output_sequence_ = (output_sequence_ + 1) & 0xf;
  return dualsense_report(bus_, output_sequence_, request);
}

}  // namespace rtpm::device_hid
