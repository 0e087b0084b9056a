#include "cli/version.hpp"

#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::tool {
namespace {

int version(Context& context, const std::string& target) {
  Json json{{"rtpm", RTPM_VERSION}, {"protocol", wire::kVersion}};
  std::string text = "rtpm " RTPM_VERSION ", H-Protocol " + std::to_string(wire::kVersion);
  bool is_same = true;
  if (!target.empty()) {
    const auto url = names::url_of(context.node(), context.registry, target);
    if (!url) return context.not_reached(url.error());
    const auto object = dynamic::RemoteObject::open(context.node(), *url);
    if (!object) return context.not_reached(object.error());
    const std::string& theirs = (*object)->compiler_version();
    is_same = theirs == RTPM_VERSION;
    json["target"] = {{"name", target}, {"rtpm", theirs}, {"is_same", is_same}};
    text += "\n" + printable(target) + ": rtpm " + printable(theirs) +
            (is_same ? "" : "; the two differ, so their schemas may");
  }
  if (context.json) {
    print_json(json);
  } else {
    print_line(text);
  }
  return is_same ? kDone : kFailed;
}

}  // namespace

void add_version(CLI::App& program, Context& context) {
  const auto target = std::make_shared<std::string>();
  CLI::App& command =
      add_command(program, context, "version", "Print the version of this program, and of a server",
                  "  rtpm version lab/arm0\nThe exit code is 1 if the two differ.\n",
                  [target](Context& c) { return version(c, *target); });
  add_target(command, *target).required(false);
}

}  // namespace rtpm::tool
