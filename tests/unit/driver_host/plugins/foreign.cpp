// A plug-in in which one fact, FOREIGN, differs from this RTPM's exports. It counts its calls.
#include "rtpm/driver/plugin.hpp"

extern "C" {
RTPM_PLUGIN_EXPORT int created_count = 0;
}

namespace {

rtpm::expected<std::unique_ptr<rtpm::driver::Driver>, rtpm::SetupError> make_nothing(
    std::string_view) {
  ++created_count;
  return rtpm::setup_error("it ran");
}

rtpm::driver::Plugin foreign_plugin() {
  rtpm::driver::Plugin plugin{.create = &make_nothing};
  FOREIGN;
  return plugin;
}

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming): the symbol that a host looks for.
extern "C" RTPM_PLUGIN_EXPORT const rtpm::driver::Plugin rtpm_driver_plugin = foreign_plugin();
