#pragma once

#include "cli/output.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/capture/event_schemas.hpp"

namespace rtpm::tool {

/// A payload as its schema describes it; without a schema, its numbers by their names; for an
/// unknown type, {"payload": hexadecimal digits}.
[[nodiscard]] Json payload_json(capture::EventSchemas& schemas, ConstBytes payload,
                                const events::EventDescriptor* type);

}  // namespace rtpm::tool
