#include "rtpm/driver_host/plugin.hpp"

#include "guarded.hpp"
#include "os/library.hpp"
#include "plugin_driver.hpp"
#include "rtpm/driver/plugin.hpp"

namespace rtpm::driver_host {
namespace {

using driver::Driver;
using driver::Plugin;

SetupError foreign(const std::string& file, std::string_view what, std::uint32_t its,
                   std::uint32_t own) {
  return {.what = "the plug-in " + file + " was built for another RTPM or by another compiler",
          .why = std::string(what) + " is " + std::to_string(its) + " there and " +
                 std::to_string(own) + " here",
          .remedy = "build it against the RTPM that is installed here"};
}

expected<void, SetupError> check(const std::string& file, const Plugin* plugin) {
  const std::string is_none = file + " is no plug-in of RTPM";
  const std::string symbol(driver::kPluginSymbol);
  const std::string remedy = "add RTPM_DRIVER_PLUGIN(function) to one of its sources";
  if (plugin == nullptr) return setup_error(is_none, "it does not export " + symbol, remedy);
  if (plugin->magic != driver::kPluginMagic) {
    return setup_error(is_none, "its " + symbol + " is something else", remedy);
  }
  const Plugin own{};
  if (plugin->abi != own.abi) {
    return unexpected{foreign(file, "the version of the interface", plugin->abi, own.abi)};
  }
  if (plugin->compiler_abi != own.compiler_abi) {
    return unexpected{foreign(file, "the compiler's ABI", plugin->compiler_abi, own.compiler_abi)};
  }
  if (plugin->sample_size != own.sample_size) {
    return unexpected{foreign(file, "the size of Sample", plugin->sample_size, own.sample_size)};
  }
  if (plugin->command_size != own.command_size) {
    return unexpected{foreign(file, "the size of Command", plugin->command_size, own.command_size)};
  }
  if (plugin->descriptor_size != own.descriptor_size) {
    return unexpected{
        foreign(file, "the size of Descriptor", plugin->descriptor_size, own.descriptor_size)};
  }
  if (plugin->create == nullptr) {
    return setup_error(is_none, "its " + symbol + " names no function that makes a driver", remedy);
  }
  return {};
}

expected<Facts, SetupError> facts_of(const std::string& file, const Driver& driver) {
  Facts facts;
  auto asked = guarded(file, "describe()", [&]() -> expected<void, SetupError> {
    facts.descriptor = driver.describe();
    return {};
  });
  if (asked) {
    asked = guarded(file, "parameters()", [&]() -> expected<void, SetupError> {
      facts.parameters = driver.parameters();
      return {};
    });
  }
  if (asked) {
    asked = guarded(file, "calibrations()", [&]() -> expected<void, SetupError> {
      facts.calibrations = driver.calibrations();
      return {};
    });
  }
  if (!asked) return unexpected{std::move(asked.error())};
  return facts;
}

}  // namespace

expected<std::unique_ptr<Driver>, SetupError> load_plugin(const std::string& file,
                                                          std::string_view arguments,
                                                          std::string_view device) {
  std::string note = "the plug-in " + file;
  if (!device.empty()) note += " of " + std::string(device);
  const rt::CrashNote crash_note(note.c_str());
  auto loaded = Library::load(file);
  if (!loaded) {
    return setup_error("the plug-in " + file + " can't be loaded", std::move(loaded.error()),
                       "name the file of a shared library that is built for this machine and "
                       "linked with all that it uses");
  }
  std::shared_ptr<Library> library = std::move(*loaded);
  const auto* const plugin = static_cast<const Plugin*>(library->symbol(driver::kPluginSymbol));
  if (auto checked = check(file, plugin); !checked) return unexpected{checked.error()};
  library->name_code_around(plugin);
  auto driver = guarded(file, "create()", [&] { return plugin->create(arguments); });
  if (!driver) return unexpected{std::move(driver.error())};
  if (*driver == nullptr) {
    return setup_error("the plug-in " + file + " made no driver",
                       "create() returned neither a driver nor an error", "ask its author");
  }
  auto facts = facts_of(file, **driver);
  if (!facts) return unexpected{std::move(facts.error())};
  return std::make_unique<PluginDriver>(file, std::move(note), std::move(library),
                                        std::move(*driver), std::move(*facts));
}

}  // namespace rtpm::driver_host
