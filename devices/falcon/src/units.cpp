#include "rtpm/device_falcon/units.hpp"

#include <optional>

namespace rtpm::device_falcon {
namespace {

std::string list_of(const std::vector<Unit>& units) {
  std::string list;
  for (const Unit& unit : units) {
    if (!list.empty()) list += ", ";
    list += "'port=" + unit.port + "' with the serial number '" + unit.serial + "'";
  }
  return list;
}

std::string name_of(const UnitChoice& choice) {
  std::string name = "Falcon";
  if (!choice.serial.empty()) name += " with the serial number '" + choice.serial + "'";
  if (!choice.port.empty()) name += " at the port " + choice.port;
  return name;
}

}  // namespace

expected<std::size_t, SetupError> choose(const std::vector<Unit>& units, const UnitChoice& choice) {
  std::optional<std::size_t> chosen;
  for (std::size_t i = 0; i < units.size(); ++i) {
    if (!choice.serial.empty() && units[i].serial != choice.serial) continue;
    if (!choice.port.empty() && units[i].port != choice.port) continue;
    if (chosen) {
      return setup_error("more than one " + name_of(choice) + " is plugged in", "",
                         "say which by its port: " + list_of(units));
    }
    chosen = i;
  }
  if (chosen) return *chosen;
  const std::string what = "no " + name_of(choice) + " is plugged in";
  if (units.empty()) return setup_error(what, "", "plug it in; it needs its own power supply, too");
  return setup_error(what, "", "give one that is there: " + list_of(units));
}

}  // namespace rtpm::device_falcon
