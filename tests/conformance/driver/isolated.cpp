#include "rtpm/driver_host/isolated.hpp"

#include "drivers.hpp"
#include "rtpm/base/assert.hpp"

namespace rtpm::test {
namespace {

/// The template as a plug-in, in a process of its own. It may be late by as much as a machine that
/// runs many tests.
std::unique_ptr<driver::Driver> make_isolated() {
  auto isolated = driver_host::isolate({.command = {RTPM_DRIVER_PROCESS, RTPM_TEMPLATE_PLUGIN, ""},
                                        .exchange_patience = std::chrono::seconds{30}});
  RTPM_ASSERT(isolated.has_value(), "the isolated driver could not be started");
  return std::move(*isolated);
}

[[maybe_unused]] const bool kIsAdded = add_driver({"Isolated", &make_isolated});

}  // namespace
}  // namespace rtpm::test
