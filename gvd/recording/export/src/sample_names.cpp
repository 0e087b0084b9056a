#include "sample_names.hpp"

#include <charconv>
#include <cstddef>

namespace rtpm::exports {
namespace {

template <class Parts>
ColumnName name_of(const Parts& parts, std::size_t index, const std::string& array) {
  if (index >= parts.size()) return {};
  return {array + "." + parts[index].name, parts[index].unit};
}

ColumnName effort(const driver::Descriptor& device, std::size_t index, const std::string& array) {
  ColumnName column = name_of(device.joints, index, array);
  if (!column.name.empty()) column.unit = column.unit == "m" ? "N" : "N m";
  return column;
}

ColumnName velocity(const driver::Descriptor& device, std::size_t index, const std::string& array) {
  ColumnName column = name_of(device.joints, index, array);
  column.unit += "/s";
  return column;
}

}  // namespace

ColumnName name_by_device(const driver::Descriptor& device, const std::string& column) {
  const std::size_t bracket = column.find('[');
  if (bracket == std::string::npos) return {column, ""};
  const std::string array = column.substr(0, bracket);
  std::size_t index = 0;
  std::from_chars(column.data() + bracket + 1, column.data() + column.size(), index);
  if (array == "joints") return name_of(device.joints, index, array);
  if (array == "joint_velocities") return velocity(device, index, array);
  if (array == "efforts") return effort(device, index, array);
  if (array == "outputs") return name_of(device.outputs, index, array);
  if (array == "analogs") return name_of(device.analogs, index, array);
  if (array != "button_edges") return {column, ""};
  if (index >= device.buttons.size()) return {};
  return {array + "." + device.buttons[index], ""};
}

}  // namespace rtpm::exports
