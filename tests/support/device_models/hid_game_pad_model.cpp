#include "hid_game_pad_model.hpp"

#include <cmath>

namespace rtpm::test {

HidIdentity GamePadModel::identity() const {
  return {0x0079, 0x0006, false, "Generic USB Joystick"};
}

HidReport GamePadModel::report_descriptor() const {
  return {0x05, 0x01, 0x09, 0x05, 0xa1, 0x01, 0x15, 0x00, 0x26, 0xff, 0x00, 0x75, 0x08, 0x95, 0x04,
          0x09, 0x30, 0x09, 0x31, 0x09, 0x32, 0x09, 0x35, 0x81, 0x02, 0x25, 0x07, 0x46, 0x3b, 0x01,
          0x65, 0x14, 0x75, 0x04, 0x95, 0x01, 0x09, 0x39, 0x81, 0x42, 0x65, 0x00, 0x05, 0x09, 0x25,
          0x01, 0x45, 0x01, 0x75, 0x01, 0x95, 0x0c, 0x19, 0x01, 0x29, 0x0c, 0x81, 0x02, 0xc0};
}

void GamePadModel::press(int button, bool is_pressed) {
  const auto bit = static_cast<std::uint16_t>(1U << button);
  buttons_ = static_cast<std::uint16_t>(is_pressed ? buttons_ | bit : buttons_ & ~bit);
  send();
}

void GamePadModel::move(int axis, double share) {
  axes_[static_cast<std::size_t>(axis)] =
      static_cast<std::uint8_t>(std::lround(127.5 * (share + 1)));
  send();
}

void GamePadModel::set_hat(std::uint8_t direction) {
  hat_ = direction;
  send();
}

void GamePadModel::send() {
  const auto low = static_cast<std::uint8_t>(hat_ | (buttons_ & 0xf) << 4);
  queue({axes_[0], axes_[1], axes_[2], axes_[3], low, static_cast<std::uint8_t>(buttons_ >> 4)});
}

}  // namespace rtpm::test
