#pragma once

#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema {

/// A schema with one service and all that it needs, and nothing to include: what a server tells of
/// its objects to whoever has no generated code. Comments, units and all that is part of
/// fingerprints is in it, so the service has the same fingerprint when the text is compiled again.
/// Attributes of other tools are left out.
[[nodiscard]] std::string schema_text(const Model& model, const Service& service);

}  // namespace rtpm::schema
