#pragma once

#include <vector>

#include "rtpm/driver/descriptor.hpp"
#include "rtpm/names/property.hpp"

namespace rtpm::gvd {

/// The properties of a device's name at the registry, for names::Directory::find(): class, model,
/// serial, frame (texts), rate_hz, axes, actuated_axes, modes (texts), force_newton_max,
/// torque_newton_metre_max, velocity_m_per_s_max, stiffness_newton_per_m_max, button_count
/// (integer), and the names of analogs, joints and outputs.
/// @param rate_hz  rate of the device's cycle
/// @realtime set-up only
[[nodiscard]] std::vector<names::Property> properties_of(const driver::Descriptor& descriptor,
                                                         double rate_hz);

}  // namespace rtpm::gvd
