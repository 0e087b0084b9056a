#pragma once

#include <nanobind/nanobind.h>

namespace rtpm::python {

/// Defines Recording: a file's topics and messages.
void define_recordings(nanobind::module_& module);

}  // namespace rtpm::python
