#pragma once

#include <cstddef>
#include <vector>

#include "rtpm/base/bytes.hpp"

namespace rtpm::device_hid {

/// The size of the header of preparsed data.
inline constexpr std::size_t kPreparsedHeaderSize = 44;
/// The size of preparsed data, which its header states; 0 if `header` has another layout.
[[nodiscard]] std::size_t preparsed_size(ConstBytes header) noexcept;

/// A report descriptor with the input reports of a top-level collection, from the preparsed data in
/// which Windows keeps them: it has no call that gives the device's own descriptor, nor one that
/// gives the places of fields. The layout is not documented; hidapi and Wine rely on it, too.
/// Padding at the end of a report is not in that data, except of the one report without a number.
/// @return empty if the data has another layout
/// @source   hidapi 0.14, windows/hidapi_descriptor_reconstruct.h
[[nodiscard]] std::vector<std::byte> report_descriptor_from(ConstBytes preparsed);

}  // namespace rtpm::device_hid
