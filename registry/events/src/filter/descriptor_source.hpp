#pragma once

#include "rtpm/events/scalar.hpp"

namespace rtpm::events {

/// What types of events there are; tells what the fields of predicates are.
class DescriptorSource {
 public:
  virtual ~DescriptorSource() = default;
  /// What is known of `type`, valid during the compilation; null if nothing is.
  [[nodiscard]] virtual const EventDescriptor* find(EventType type) const noexcept = 0;
};

}  // namespace rtpm::events
