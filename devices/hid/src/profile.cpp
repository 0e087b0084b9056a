#include "rtpm/device_hid/profile.hpp"

#include <algorithm>

#include "rtpm/device_hid/profiles.hpp"
#include "rtpm/device_io/buttons.hpp"

namespace rtpm::device_hid {
namespace {

constexpr std::uint16_t kLogitech = 0x046d;  // Vendor id of older devices by 3Dconnexion.
constexpr std::uint16_t k3Dconnexion = 0x256f;
constexpr std::uint16_t kSony = 0x054c;

struct Product {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  Kind kind{};
};
constexpr std::array kProducts{
    Product{kLogitech, 0xc603, Kind::kSpaceMouse},
    Product{kLogitech, 0xc605, Kind::kSpaceMouse},
    Product{kLogitech, 0xc606, Kind::kSpaceMouse},
    Product{kLogitech, 0xc621, Kind::kSpaceMouse},
    Product{kLogitech, 0xc623, Kind::kSpaceMouse},
    Product{kLogitech, 0xc625, Kind::kSpaceMouse},
    Product{kLogitech, 0xc626, Kind::kSpaceMouse},
    Product{kLogitech, 0xc627, Kind::kSpaceMouse},
    Product{kLogitech, 0xc628, Kind::kSpaceMouse},
    Product{kLogitech, 0xc629, Kind::kSpaceMouse},
    Product{kLogitech, 0xc62b, Kind::kSpaceMouse},
    Product{kLogitech, 0xc640, Kind::kSpaceMouse},
    Product{k3Dconnexion, 0xc62e, Kind::kSpaceMouse},
    Product{k3Dconnexion, 0xc62f, Kind::kSpaceMouse},
    Product{k3Dconnexion, 0xc631, Kind::kSpaceMouse},
    Product{k3Dconnexion, 0xc632, Kind::kSpaceMouse},
    Product{k3Dconnexion, 0xc633, Kind::kSpaceMouse},
    Product{k3Dconnexion, 0xc635, Kind::kSpaceMouse},
    Product{k3Dconnexion, 0xc636, Kind::kSpaceMouse},
    Product{k3Dconnexion, 0xc638, Kind::kSpaceMouse},
    Product{k3Dconnexion, 0xc63a, Kind::kSpaceMouse},
    Product{k3Dconnexion, 0xc652, Kind::kSpaceMouse},
    Product{kSony, 0x05c4, Kind::kDualShock4},
    Product{kSony, 0x09cc, Kind::kDualShock4},
    Product{kSony, 0x0ce6, Kind::kDualSense},
    Product{0x1209, 0xffb0, Kind::kOpenFfBoard},
};

constexpr std::uint32_t kJoystick = kDesktopPage + 4;
constexpr std::uint32_t kPad = kDesktopPage + 5;
constexpr std::uint32_t kMultiAxis = kDesktopPage + 8;

template <class IsWanted>
bool has_application(const Unit& unit, IsWanted is_wanted) {
  const auto descriptor = parse_report_descriptor(unit.report_descriptor);
  return descriptor && std::ranges::any_of(descriptor->inputs, [&](const Field& field) {
           return is_wanted(field.application);
         });
}

}  // namespace

bool is_pad_application(std::uint32_t usage) noexcept {
  return usage == kJoystick || usage == kPad || usage == kMultiAxis;
}

void State::set_buttons(std::uint32_t pressed) noexcept {
  device_io::count_edges(buttons, pressed, button_edges);
  buttons = pressed;
}

void State::release() noexcept {
  set_buttons(0);
  analogs = {};
  joint_velocity = 0;
}

OutputReport Profile::encode(const Request&) noexcept {
  return {};
}

std::string_view to_string(Kind kind) noexcept {
  switch (kind) {
    case Kind::kSpaceMouse:
      return "spacemouse";
    case Kind::kGamePad:
      return "gamepad";
    case Kind::kDualShock4:
      return "dualshock4";
    case Kind::kDualSense:
      return "dualsense";
    case Kind::kOpenFfBoard:
      return "openffboard";
  }
  return "";
}

std::optional<Kind> kind_named(std::string_view name) noexcept {
  for (const Kind kind : kKinds) {
    if (to_string(kind) == name) return kind;
  }
  return std::nullopt;
}

std::optional<Kind> kind_of(const Unit& unit) {
  for (const Product& product : kProducts) {
    if (product.vendor != unit.vendor || product.product != unit.product) continue;
    // A receiver has additional interfaces, such as that of a mouse.
    const bool is_other = product.kind == Kind::kSpaceMouse && !unit.report_descriptor.empty() &&
                          !has_application(unit, [](auto usage) { return usage == kMultiAxis; });
    return is_other ? std::nullopt : std::optional(product.kind);
  }
  if (has_application(unit, is_pad_application)) return Kind::kGamePad;
  return std::nullopt;
}

std::string refusal_of(const Unit& unit) {
  if (kind_of(unit)) return {};
  const auto descriptor = parse_report_descriptor(unit.report_descriptor);
  if (!descriptor) return "its report descriptor is unreadable: " + descriptor.error();
  const bool is_pad = std::ranges::any_of(descriptor->unread, [](const UnreadFields& fields) {
    return is_pad_application(fields.application);
  });
  return is_pad ? "its reports have neither axes nor buttons of the known pages" : "";
}

std::unique_ptr<Profile> make_profile(Kind kind, const Unit* unit, double torque_newton_metre_max) {
  switch (kind) {
    case Kind::kSpaceMouse:
      return std::make_unique<SpaceMouse>(unit != nullptr ? unit->product : std::uint16_t{0});
    case Kind::kGamePad:
      return std::make_unique<GamePad>(unit);
    case Kind::kDualShock4:
      return std::make_unique<SonyPad>(SonyPad::Model::kDualShock4);
    case Kind::kDualSense:
      return std::make_unique<SonyPad>(SonyPad::Model::kDualSense);
    case Kind::kOpenFfBoard:
      return std::make_unique<OpenFfBoard>(torque_newton_metre_max);
  }
  return nullptr;
}

}  // namespace rtpm::device_hid
