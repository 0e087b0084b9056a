#pragma once

#include <nanobind/nanobind.h>

namespace rtpm::python {

/// Defines Device, Servo and Pacer. Samples, commands and models go as their wire bytes.
void define_devices(nanobind::module_& module);

}  // namespace rtpm::python
