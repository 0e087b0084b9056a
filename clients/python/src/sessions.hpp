#pragma once

#include <nanobind/nanobind.h>

namespace rtpm::python {

/// Defines LiveRecording: the recording of a session while the program runs.
void define_sessions(nanobind::module_& module);

}  // namespace rtpm::python
