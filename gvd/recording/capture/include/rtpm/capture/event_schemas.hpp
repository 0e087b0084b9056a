#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "rtpm/events/event.hpp"
#include "rtpm/events/scalar.hpp"
#include "rtpm/schema/dynamic.hpp"

namespace rtpm::capture {

/// The schemas of events, each read once.
/// @threads  one
class EventSchemas {
 public:
  /// Returns nullptr if the type is null, or its schema is unknown or can't be read.
  [[nodiscard]] schema::Dynamic* find(const events::EventDescriptor* type);

 private:
  struct Entry {
    std::uint64_t schema_id = 0;
    std::unique_ptr<schema::Dynamic> dynamic{};
  };
  std::map<events::EventType, Entry> entries_{};
};

/// "lab.Touched", or the number.
[[nodiscard]] std::string type_text(events::EventType type, const events::EventDescriptor* known);

}  // namespace rtpm::capture
