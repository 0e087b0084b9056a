#pragma once

#include "rtpm/events/scalar.hpp"

namespace rtpm::events {

/// Looks up the fields of event types for the compiler.
class DescriptorSource {
 public:
  virtual ~DescriptorSource() = default;
  /// The descriptor of `type`, valid during the compilation; null if unknown.
  [[nodiscard]] virtual const EventDescriptor* find(EventType type) const noexcept = 0;
};

}  // namespace rtpm::events
