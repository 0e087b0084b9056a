#pragma once

#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>

#include <cstdint>
#include <string>

#include "rtpm/base/bytes.hpp"

/// A type of Cyclone DDS whose samples are finished CDR, so that a program can write and read types
/// that it was not compiled with.
namespace rtpm::ros2 {

/// Makes a type, with one reference, which dds_create_topic_sertype() takes over.
/// @param size_max  larger messages of peers become empty samples
[[nodiscard]] ddsi_sertype* make_opaque_type(const std::string& name, std::uint32_t size_max);
/// Makes a sample, with one reference, which dds_writecdr() takes over.
[[nodiscard]] ddsi_serdata* make_opaque_sample(const ddsi_sertype* type, ConstBytes cdr);
/// The sample's CDR. Valid as long as the sample.
[[nodiscard]] ConstBytes cdr_of(const ddsi_serdata* sample) noexcept;

}  // namespace rtpm::ros2
