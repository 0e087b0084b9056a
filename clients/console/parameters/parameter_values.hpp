#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "foxglove/replies.hpp"
#include "foxglove/requests.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/configuration/client.hpp"
#include "rtpm/driver/parameter.hpp"

namespace rtpm::console {

/// The parameters of an object with the values in `settings`, as the protocol shows them:
/// "lab/arm0.safety.ramp_s".
[[nodiscard]] std::vector<foxglove::ParameterInfo> infos_of(
    const std::string& object, const std::vector<driver::ParameterSetting>& settings);

/// The value that a client sent for `parameter`, converted to its type; the range is not checked.
/// @errors   described in words: the value has another type
[[nodiscard]] expected<driver::ParameterValue, std::string> value_of(
    const gvd::Parameter& parameter, const nlohmann::json& value);

/// Splits "lab/arm0.safety.ramp_s" into object and parameter; `objects` lists the objects' names.
/// @return an empty object if none matches
struct ParameterName {
  std::string object{};
  std::string parameter{};
};
[[nodiscard]] ParameterName split_name(const std::string& name,
                                       const std::vector<std::string>& objects);

}  // namespace rtpm::console
