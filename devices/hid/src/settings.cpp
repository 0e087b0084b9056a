#include "rtpm/device_hid/settings.hpp"

#include <algorithm>

#include "rtpm/driver/arguments.hpp"

namespace rtpm::device_hid {
namespace {

constexpr double kTorqueMax = 100;

std::string kind_names() {
  std::string names;
  for (const Kind kind : kKinds)
    names += (names.empty() ? "" : ", ") + std::string(to_string(kind));
  return names;
}

bool is_known(const Identity& known, const Unit& unit) {
  if (!known.serial.empty()) return unit.serial == known.serial;
  return known.port.empty() ? unit.node == known.node : unit.port == known.port;
}

std::string names_of(const std::vector<const Unit*>& units) {
  std::string names;
  for (const Unit* const unit : units) {
    if (!names.empty()) names += ", ";
    names += unit->node + " (" + unit->model;
    if (!unit->serial.empty()) names += ", serial number " + unit->serial;
    names += ")";
  }
  return names;
}

}  // namespace

expected<Settings, SetupError> read_settings(std::string_view arguments) {
  const auto words = driver::read_words(
      "hid", arguments, {.names = {"kind", "serial", "node", "torque_newton_metre"}});
  if (!words) return unexpected{words.error()};
  Settings settings;
  settings.serial = driver::value_of(*words, "serial");
  settings.node = driver::value_of(*words, "node");
  if (const std::string kind = driver::value_of(*words, "kind"); !kind.empty()) {
    settings.kind = kind_named(kind);
    if (!settings.kind) {
      return setup_error("the driver hid knows no kind '" + kind + "'", "",
                         "name one of " + kind_names());
    }
  }
  if (const std::string text = driver::value_of(*words, "torque_newton_metre"); !text.empty()) {
    const auto torque = driver::to_number<double>(text);
    if (!torque || !(*torque > 0 && *torque <= kTorqueMax)) {
      return setup_error("torque_newton_metre is '" + text + "'", "it is above 0, at most 100",
                         "give the motor's torque at the board's full power");
    }
    settings.torque_newton_metre = *torque;
  }
  return settings;
}

Identity identity_of(const Unit& unit) {
  return {unit.serial, unit.port, unit.node};
}

std::optional<Kind> kind_for(const Settings& settings, const Unit& unit) {
  const auto kind = kind_of(unit);
  if (!kind || !settings.kind || *kind == *settings.kind) return kind;
  return settings.kind == Kind::kGamePad ? settings.kind : std::nullopt;
}

expected<const Unit*, SetupError> choose(const std::vector<Unit>& units, const Settings& settings,
                                         const Identity* known) {
  std::vector<const Unit*> fitting;
  for (const Unit& unit : units) {
    const bool is_asked_for = known != nullptr
                                  ? is_known(*known, unit)
                                  : (settings.serial.empty() || unit.serial == settings.serial) &&
                                        (settings.node.empty() || unit.node == settings.node);
    if (is_asked_for && kind_for(settings, unit)) fitting.push_back(&unit);
  }
  // If two units have the same serial number, chooses the one on the same port.
  if (known != nullptr && fitting.size() > 1) {
    std::erase_if(fitting, [&](const Unit* unit) {
      return known->port.empty() ? unit->node != known->node : unit->port != known->port;
    });
  }
  if (fitting.size() > 1) {
    return setup_error("several HID devices fit", names_of(fitting),
                       settings.serial.empty() ? "give serial= or node= as an argument"
                                               : "they share the serial number: give node= too");
  }
  return fitting.empty() ? nullptr : fitting.front();
}

}  // namespace rtpm::device_hid
