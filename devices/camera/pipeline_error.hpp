#pragma once

#include <gst/gst.h>

#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::camerad {

/// The Debian package with an element: "gstreamer1.0-plugins-ugly" of "x264enc"; a way to find it
/// for an element that is not known.
[[nodiscard]] std::string package_of(std::string_view element);

/// Why a pipeline's text makes no pipeline, with the Debian package of a missing element.
[[nodiscard]] SetupError parse_error(const GError& error);
/// The error that a message on a pipeline's bus has: the element, the cause, the remedy.
[[nodiscard]] SetupError run_error(GstMessage& message);

}  // namespace rtpm::camerad
