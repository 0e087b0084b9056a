#pragma once

#include <string>

#include "rtpm/base/bytes.hpp"

namespace rtpm::console::foxglove {

/// Encodes bytes in standard base64 with padding, as the protocol requires for binary schemas.
[[nodiscard]] std::string to_base64(ConstBytes bytes);

}  // namespace rtpm::console::foxglove
