#include <nanobind/nanobind.h>

#include "calls.hpp"
#include "devices.hpp"
#include "events.hpp"
#include "node.hpp"
#include "recordings.hpp"
#include "schema.hpp"
#include "servants.hpp"
#include "sessions.hpp"
#include "waiting.hpp"

NB_MODULE(_core, module) {
  // Classes and descriptors live until the program ends.
  nanobind::set_leak_warnings(false);
  module.attr("version") = RTPM_VERSION;
  module.def("end_threads", &rtpm::python::end_threads);
  module.def("forget_threads", &rtpm::python::forget_threads);
  rtpm::python::define_schema(module);
  rtpm::python::define_node(module);
  rtpm::python::define_calls(module);
  rtpm::python::define_devices(module);
  rtpm::python::define_servants(module);
  rtpm::python::define_events(module);
  rtpm::python::define_recordings(module);
  rtpm::python::define_sessions(module);
}
