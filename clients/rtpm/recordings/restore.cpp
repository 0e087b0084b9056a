#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cli/output.hpp"
#include "devices/parameters.hpp"
#include "recordings/commands.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/parameters.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::tool {
namespace {

/// The outcome for one device.
struct Restored {
  std::string device;
  std::vector<driver::ParameterSetting> settings{};  ///< That were changed.
  std::size_t same_count = 0;
  std::vector<std::string> fixed{};     ///< They differ, and no client can set them.
  std::optional<SetupError> problem{};  ///< Then nothing was changed.
};

std::vector<driver::ParameterSetting> differing(const gvd::DeviceConfiguration& recorded,
                                                const gvd::DeviceConfiguration& present,
                                                Restored& result) {
  std::vector<driver::ParameterSetting> settings;
  for (const gvd::Parameter& parameter : recorded.parameters) {
    const gvd::Parameter* const known = present.find(parameter.spec.name);
    if (known != nullptr && known->value == parameter.value) {
      ++result.same_count;
      continue;
    }
    if (parameter.spec.mutability == driver::Mutability::kReadOnly) {
      result.fixed.push_back(parameter.spec.name);
      continue;
    }
    settings.push_back({parameter.spec.name, parameter.value});
  }
  return settings;
}

Restored restore(Context& context, const capture::RecordedParameters& recorded,
                 const std::string& device) {
  Restored result{.device = device};
  auto client = open_configuration(context, device);
  if (!client) {
    result.problem = client.error();
    return result;
  }
  const auto present = client->list();
  if (!present) {
    result.problem = present.error().words;
    return result;
  }
  const gvd::DeviceConfiguration& wanted = recorded.last;
  if (present->model != wanted.model || present->serial != wanted.serial) {
    result.problem = SetupError{
        .what = "it is another unit, with calibrations of its own",
        .why = "recorded: " + printable(wanted.model) + ", serial " + printable(wanted.serial) +
               "; here: " + printable(present->model) + ", serial " + printable(present->serial),
        .remedy =
            "see the values by `rtpm bag info FILE --parameters`, and set some by `rtpm "
            "config set`"};
    return result;
  }
  auto settings = differing(wanted, *present, result);
  if (settings.empty()) return result;
  const auto applied = client->apply(present->revision, settings);
  if (applied) {
    result.settings = applied->settings;
  } else {
    result.problem = applied.error().words;
  }
  return result;
}

std::string text_of(const Restored& restored) {
  std::string text = printable(restored.device) + ": ";
  if (restored.problem) return text + "refused, nothing changed: " + restored.problem->text();
  text += std::to_string(restored.settings.size()) + " set, " +
          std::to_string(restored.same_count) + " as recorded already";
  const std::string lines = lines_of(restored.settings);
  for (std::size_t begin = 0; begin < lines.size();) {
    const std::size_t end = lines.find('\n', begin);
    text += "\n  " + lines.substr(begin, end - begin);
    begin = end + 1;
  }
  for (const std::string& name : restored.fixed)
    text += "\n  " + printable(name) + " differs, and can't be set";
  return text;
}

Json restored_json(const Restored& restored) {
  Json json{{"device", restored.device},
            {"set", json_of(restored.settings)},
            {"same_count", restored.same_count},
            {"fixed", restored.fixed}};
  json["problem"] = restored.problem ? Json(restored.problem->text()) : Json();
  return json;
}

/// The recorded parameters of the requested devices.
expected<std::vector<capture::RecordedParameters>, SetupError> read(const RestoreRequest& request) {
  const auto reader = recording::FileReader::open(request.file, recording::Incomplete::kRead);
  if (!reader) return unexpected{reader.error()};
  const std::uint64_t begin_ns = (*reader)->statistics().begin_ns;
  const auto from_ns = static_cast<std::uint64_t>(request.from.count());
  auto all = capture::read_parameters(**reader);
  if (!all) return all;
  const auto until = capture::read_parameters(
      **reader, from_ns > UINT64_MAX - begin_ns ? UINT64_MAX : begin_ns + from_ns);
  if (!until) return until;
  for (capture::RecordedParameters& one : *all) {
    const auto found = std::ranges::find(*until, one.device, &capture::RecordedParameters::device);
    // The values of the beginning are read a moment later.
    one.last = found == until->end() ? one.first : found->last;
  }
  if (request.devices.empty() && !all->empty()) return all;
  std::vector<std::string> names;
  for (const capture::RecordedParameters& one : *all)
    names.push_back(one.device);
  if (names.empty()) {
    return setup_error(request.file + " has no parameters of a device", "",
                       "record some by rtpm record or rtpm session");
  }
  std::vector<capture::RecordedParameters> chosen;
  for (const std::string& name : request.devices) {
    const auto found = std::ranges::find(*all, name, &capture::RecordedParameters::device);
    if (found == all->end()) {
      return setup_error(request.file + " has no parameters of '" + name + "'" +
                         program::suggestion(name, names));
    }
    chosen.push_back(*found);
  }
  return chosen;
}

}  // namespace

int restore_parameters(Context& context, const RestoreRequest& request) {
  const auto recorded = read(request);
  if (!recorded) return context.fail(recorded.error());
  Json json = Json::array();
  bool is_refused = false;
  for (const capture::RecordedParameters& one : *recorded) {
    const std::string name =
        request.folder.empty() ? one.device : request.folder + "/" + one.device;
    const Restored restored = restore(context, one, name);
    is_refused = is_refused || restored.problem.has_value();
    if (context.json) {
      json.push_back(restored_json(restored));
    } else {
      print_line(text_of(restored));
    }
  }
  if (context.json) print_json(json);
  return is_refused ? kFailed : kDone;
}

}  // namespace rtpm::tool
