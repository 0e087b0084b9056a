#include <memory>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "objects/commands.hpp"
#include "objects/unbound.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/base/utf8_path.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/schema/back_end.hpp"
#include "rtpm/schema/output.hpp"

namespace rtpm::tool {
namespace {

/// "arm0" for "lab/arm0" and for the URL of that object.
std::string stem_of(const std::string& target) {
  return target.substr(target.find_last_of('/') + 1);
}

int stubs(Context& context, const std::string& target, const std::string& folder) {
  const auto url = names::url_of(context.node(), context.registry, target);
  if (!url) return context.not_reached(with_loss(context, target, url.error()));
  const auto object = dynamic::RemoteObject::open(context.node(), *url);
  if (!object) return context.not_reached(object.error());
  schema::Model model = (*object)->dynamic().model();
  model.file_stem = printable(stem_of(target));
  const auto python = schema::make_python_back_end(RTPM_VERSION);
  if (const auto errors = python->check(model); !errors.empty()) {
    return context.fail({.what = target + ": Python can't express its schema",
                         .why = printable(errors.front().message),
                         .remedy = errors.front().hint});
  }
  std::vector<schema::OutputFile> files;
  for (schema::GeneratedFile& file : python->generate(model))
    files.push_back(
        {utf8_of(path_of_utf8(folder) / path_of_utf8(file.name)), std::move(file.text)});
  if (const auto error = schema::write_all(files)) return context.fail(*error);
  Json paths = Json::array();
  for (const schema::OutputFile& file : files) {
    if (!context.json) print_line(printable(file.path));
    paths.push_back(file.path);
  }
  if (context.json) print_json({{"files", std::move(paths)}});
  return kDone;
}

}  // namespace

void add_stubs(CLI::App& program, Context& context) {
  struct Request {
    std::string target{};
    std::string folder = ".";
  };
  const auto request = std::make_shared<Request>();
  CLI::App& command = add_command(
      program, context, "stubs", "Write an object's schema as a Python module with types",
      "  rtpm stubs lab/arm0 -o src/lab       # arm0_rtpm.py, and arm0_rtpm.pyi for type checkers\n"
      "The module is the one that `rtpmc --emit python` generates from the output of `rtpm "
      "info`.\n",
      [request](Context& c) { return stubs(c, request->target, request->folder); });
  add_target(command, request->target);
  command.add_option("-o,--output", request->folder, "The folder, made if it is missing")
      ->capture_default_str()
      ->type_name("FOLDER");
}

}  // namespace rtpm::tool
