#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "cli/output.hpp"
#include "rtpm/events/scalar.hpp"
#include "rtpm/schema/dynamic.hpp"

namespace rtpm::tool {

/// The schemas of events, each read once.
/// @threads  one
class EventSchemas {
 public:
  /// nullptr: the type is null, or its schema is not known or can't be read.
  [[nodiscard]] schema::Dynamic* find(const events::EventDescriptor* type);

  /// A payload by its schema; without one its numbers by their names; of an unknown type
  /// {"payload": hexadecimal digits}.
  [[nodiscard]] Json json_of(ConstBytes payload, const events::EventDescriptor* type);

 private:
  struct Entry {
    std::uint64_t schema_id = 0;
    std::unique_ptr<schema::Dynamic> dynamic{};
  };
  std::map<events::EventType, Entry> entries_{};
};

}  // namespace rtpm::tool
