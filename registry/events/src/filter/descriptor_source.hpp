#pragma once

#include "rtpm/events/scalar.hpp"

namespace rtpm::events {

/// Provides the fields of event types to the compiler.
class DescriptorSource {
 public:
  virtual ~DescriptorSource() = default;
  /// The descriptor of `type`, valid during compilation; null if unknown.
  [[nodiscard]] virtual const EventDescriptor* find(EventType type) const noexcept = 0;
};

}  // namespace rtpm::events
