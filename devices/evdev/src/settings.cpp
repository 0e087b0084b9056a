#include "rtpm/device_evdev/settings.hpp"

#include <algorithm>
#include <numbers>
#include <utility>
#include <vector>

#include "rtpm/driver/arguments.hpp"

namespace rtpm::device_evdev {
namespace {

using driver::Words;

/// A numeric setting and the variable that it sets.
struct Number {
  std::string_view name;
  double low;
  double high;
  double unit;  ///< Factor from the setting's unit to the unit of `to`.
  double* to;
};

expected<void, SetupError> read_number(const Words& words, const Number& number) {
  const auto word = words.find(number.name);
  if (word == words.end()) return {};
  const std::string& text = word->second;
  const auto value = driver::to_number<double>(text);
  if (!value || !(*value >= number.low && *value <= number.high)) {
    return setup_error(
        "the driver evdev can't use " + word->first + "=" + text, "",
        "give a number from " + std::to_string(number.low) + " to " + std::to_string(number.high));
  }
  *number.to = *value * number.unit;
  return {};
}

expected<void, SetupError> read_flag(const Words& words, std::string_view name, bool& flag) {
  const auto word = words.find(name);
  if (word == words.end()) return {};
  if (word->second != "yes" && word->second != "no") {
    return setup_error("the driver evdev can't use " + word->first + "=" + word->second, "",
                       "give " + word->first + "=yes or " + word->first + "=no");
  }
  flag = word->second == "yes";
  return {};
}

bool is_meant(const Unit& unit, const Settings& settings) {
  const auto fits = [](const std::string& wanted, const std::string& found) {
    return wanted.empty() || wanted == found;
  };
  return fits(settings.serial, unit.serial) && fits(settings.path, unit.path) &&
         fits(settings.node, unit.node) && fits(settings.name, unit.name) &&
         (settings.names_one() || unit.is_joystick);
}

/// Compares serial numbers, or ports if the unit has no serial number or the operator specified the
/// port; never nodes, which change.
bool is_same_unit(const Unit& unit, const Unit& known, const Settings& settings) {
  const bool goes_by_path = known.serial.empty() || !settings.path.empty();
  return unit.name == known.name && unit.vendor == known.vendor && unit.product == known.product &&
         (goes_by_path ? unit.path == known.path : unit.serial == known.serial);
}

std::string list(const std::vector<Unit>& units) {
  std::string text;
  for (const Unit& unit : units) {
    if (!text.empty()) text += ", ";
    text += unit.node + " (" + unit.name + (unit.path.empty() ? "" : " at " + unit.path) + ")";
  }
  return text;
}

std::string words_of(const Settings& settings) {
  std::string text;
  for (const auto& [name, value] : {std::pair{"serial", settings.serial},
                                    {"path", settings.path},
                                    {"node", settings.node},
                                    {"name", settings.name}}) {
    if (!value.empty()) text += std::string(text.empty() ? " with " : " ") + name + "=" + value;
  }
  return text;
}

}  // namespace

expected<Settings, SetupError> read_settings(std::string_view words) {
  const auto known = driver::read_words(
      "evdev", words,
      {.names = {"serial", "path", "node", "grab", "gain", "range_degree", "torque_newton_metre",
                 "reverse", "counts_per_inch", "counts_per_turn"},
       .names_to_the_end = {"name"}});
  if (!known) return unexpected{known.error()};
  Settings settings;
  settings.serial = driver::value_of(*known, "serial");
  settings.path = driver::value_of(*known, "path");
  settings.node = driver::value_of(*known, "node");
  settings.name = driver::value_of(*known, "name");
  for (const auto& [name, flag] :
       {std::pair{"grab", &settings.is_grabbed}, {"reverse", &settings.scales.is_reversed}}) {
    if (const auto done = read_flag(*known, name, *flag); !done) return unexpected{done.error()};
  }
  Scales& scales = settings.scales;
  constexpr double kInchesPerMetre = 1 / 0.0254;
  for (const Number& number :
       {Number{"gain", 0, 1, 1, &settings.gain},
        Number{"range_degree", 1, 3600, std::numbers::pi / 180, &scales.wheel_range_rad},
        Number{"torque_newton_metre", 0.001, 50, 1, &scales.effort_newton_metre_max},
        Number{"counts_per_inch", 1, 100'000, kInchesPerMetre, &scales.counts_per_m},
        Number{"counts_per_turn", 1, 1'000'000, 1, &scales.counts_per_turn}}) {
    if (const auto done = read_number(*known, number); !done) return unexpected{done.error()};
  }
  return settings;
}

expected<Unit, SetupError> choose(std::span<const Unit> units, const Settings& settings,
                                  const std::optional<Unit>& known) {
  std::vector<Unit> found;
  for (const Unit& unit : units) {
    if (known ? is_same_unit(unit, *known, settings) : is_meant(unit, settings)) {
      found.push_back(unit);
    }
  }
  const std::string words = words_of(settings);
  if (found.empty()) {
    const std::string what = settings.names_one() ? "input device" + words : "joystick or game pad";
    return setup_error("no " + what + " is plugged in", "",
                       "plug it in, or see rtpm-deviced --probe");
  }
  const auto joysticks = std::ranges::count_if(found, &Unit::is_joystick);
  if (found.size() > 1 && joysticks == 1) return *std::ranges::find_if(found, &Unit::is_joystick);
  if (found.size() > 1) {
    return setup_error("several input devices" + words + " are alike", list(found),
                       "give path= of the port, name= or node=");
  }
  return found.front();
}

}  // namespace rtpm::device_evdev
