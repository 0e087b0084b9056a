#pragma once

#include <string>

#include "rtpm/base/bytes.hpp"

namespace rtpm::console::foxglove {

/// The bytes in standard base64, with padding: how the protocol carries binary schemas.
[[nodiscard]] std::string to_base64(ConstBytes bytes);

}  // namespace rtpm::console::foxglove
