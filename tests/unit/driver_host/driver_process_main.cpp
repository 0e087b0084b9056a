// The process of an isolated driver: a plug-in and its arguments.
#include "rtpm/driver_host/isolated.hpp"
#include "rtpm/driver_host/plugin.hpp"
#include "rtpm/rt/crash.hpp"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  rtpm::rt::report_crashes("driver_process", "");
  return rtpm::driver_host::serve_driver(
      rtpm::driver_host::load_plugin(argv[1], argv[2], "lab/puppet"),
      {.name = "drv-puppet", .realtime = rtpm::rt::RealtimeMode::kOff});
}
