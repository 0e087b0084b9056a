#include "parameter_text.hpp"

#include "rtpm/base/printable.hpp"
#include "rtpm/configuration/value_text.hpp"
#include "table.hpp"

namespace rtpm::tool {
namespace {

std::string text_of(const driver::ParameterValue& value) {
  return printable(gvd::to_text(value), kShownWhole);
}

}  // namespace

std::string table_of(const gvd::DeviceConfiguration& configuration) {
  std::vector<Row> rows{{"NAME", "VALUE", "UNIT", "RANGE", "DEFAULT", "CHANGES", "DESCRIPTION"}};
  for (const gvd::Parameter& parameter : configuration.parameters) {
    const driver::ParameterSpec& spec = parameter.spec;
    rows.push_back({printable(spec.name), text_of(parameter.value), printable(spec.unit),
                    printable(gvd::range_text(spec)), text_of(spec.default_value),
                    std::string(to_string(spec.mutability)), printable(spec.description)});
  }
  return aligned(rows, rows.front().size());
}

std::string lines_of(const std::vector<driver::ParameterSetting>& settings) {
  std::string text;
  for (const driver::ParameterSetting& setting : settings)
    text += printable(setting.name) + "=" + text_of(setting.value) + "\n";
  return text;
}

}  // namespace rtpm::tool
