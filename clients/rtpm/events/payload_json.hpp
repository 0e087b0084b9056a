#pragma once

#include "cli/output.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/capture/event_schemas.hpp"

namespace rtpm::tool {

/// A payload as JSON according to its schema; without a schema, its numbers by name; for an unknown
/// type, {"payload": hexadecimal digits}.
[[nodiscard]] Json payload_json(capture::EventSchemas& schemas, ConstBytes payload,
                                const events::EventDescriptor* type);

}  // namespace rtpm::tool
