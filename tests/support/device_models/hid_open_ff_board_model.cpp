#include "hid_open_ff_board_model.hpp"

#include <algorithm>
#include <cmath>

namespace rtpm::test {
namespace {

constexpr std::uint8_t kCommandReport = 0xa1;
constexpr std::uint8_t kWrite = 0;
constexpr std::uint8_t kRequest = 1;
constexpr std::uint8_t kWriteAddress = 3;
constexpr std::uint8_t kRequestAddress = 4;
constexpr std::uint8_t kAcknowledge = 10;
constexpr std::uint8_t kNotFound = 13;

}  // namespace

HidIdentity OpenFfBoardModel::identity() const {
  return {0x1209, 0xffb0, false, "FFBoard"};
}

HidReport OpenFfBoardModel::report_descriptor() const {
  return {0x05, 0x01, 0x09, 0x04, 0xa1, 0x01, 0x85, 0x01, 0x05, 0x09, 0x19, 0x01, 0x29, 0x40,
          0x15, 0x00, 0x25, 0x01, 0x95, 0x40, 0x75, 0x01, 0x81, 0x02, 0x05, 0x01, 0x09, 0x30,
          0x09, 0x31, 0x09, 0x32, 0x09, 0x33, 0x09, 0x34, 0x09, 0x35, 0x09, 0x37, 0x09, 0x36,
          0x16, 0x01, 0x80, 0x26, 0xff, 0x7f, 0x75, 0x10, 0x95, 0x08, 0x81, 0x02, 0x06, 0x00,
          0xff, 0x09, 0x00, 0xa1, 0x01, 0x85, 0xa1, 0x09, 0x01, 0x15, 0x00, 0x26, 0xff, 0x00,
          0x75, 0x08, 0x95, 0x18, 0x81, 0x02, 0x09, 0x01, 0x91, 0x02, 0xc0, 0xc0};
}

bool OpenFfBoardModel::write(const HidReport& report) {
  if (report.size() != 25 || report[0] != kCommandReport) return false;
  const std::uint8_t type = report[1];
  const auto handler = static_cast<std::uint16_t>(get_le(report, 2, 2));
  const auto number = static_cast<std::uint32_t>(get_le(report, 5, 4));
  if (handler == 0xa01 && number == 1 && type == kRequest) {
    answer(report, kRequest, kRangeDegrees);
  } else if (handler == 0xa03) {
    take_effect_command(report, type, number);
  } else {
    answer(report, kNotFound, 0);
  }
  return true;
}

void OpenFfBoardModel::take_effect_command(const HidReport& report, std::uint8_t type,
                                           std::uint32_t number) {
  const auto value = static_cast<std::int64_t>(get_le(report, 9, 8));
  const std::uint64_t address = get_le(report, 17, 8);
  const bool has_effect = address < effects_.size() && type == kWriteAddress;
  if (number == 0 && type == kWrite) {
    is_active_ = value != 0;
  } else if (number == 1 && type == kRequest) {
    effects_ = {};
    is_active_ = false;
  } else if (number == 1 && type == kRequestAddress && address < effects_.size()) {
    effects_[address] = {};
  } else if (number == 2 && type == kWrite) {
    const auto free = std::ranges::find(effects_, false, &Effect::is_made);
    if (free != effects_.end()) free->is_made = true;
    answer(report, kWrite, free == effects_.end() ? -1 : free - effects_.begin());
    return;
  } else if (number == 4 && has_effect) {
    effects_[address].magnitude = static_cast<std::int16_t>(value);
  } else if (number == 5 && has_effect) {
    effects_[address].is_running = value != 0;
  } else {
    answer(report, kNotFound, 0);
    return;
  }
  answer(report, kAcknowledge, value);
}

void OpenFfBoardModel::answer(const HidReport& command, std::uint8_t type, std::int64_t value) {
  HidReport report = command;
  report[1] = type;
  put_le(report, 9, static_cast<std::uint64_t>(value), 8);
  queue(report);
}

double OpenFfBoardModel::torque_share() const {
  if (!is_active_) return 0;
  double sum = 0;
  for (const Effect& effect : effects_) {
    if (effect.is_made && effect.is_running) sum += effect.magnitude / 32'767.0;
  }
  return std::clamp(sum, -1.0, 1.0);
}

int OpenFfBoardModel::effect_count() const {
  return static_cast<int>(std::ranges::count(effects_, true, &Effect::is_made));
}

void OpenFfBoardModel::press(int button, bool is_pressed) {
  const std::uint64_t bit = std::uint64_t{1} << button;
  buttons_ = is_pressed ? buttons_ | bit : buttons_ & ~bit;
}

void OpenFfBoardModel::move(int axis, double share) {
  axes_[static_cast<std::size_t>(axis)] = static_cast<std::int16_t>(std::lround(share * 32'767));
}

void OpenFfBoardModel::send_period() {
  HidReport report(25);
  report[0] = 1;
  put_le(report, 1, buttons_, 8);
  for (std::size_t i = 0; i < axes_.size(); ++i)
    put_le(report, 9 + 2 * i, static_cast<std::uint16_t>(axes_[i]), 2);
  queue(report);
}

}  // namespace rtpm::test
