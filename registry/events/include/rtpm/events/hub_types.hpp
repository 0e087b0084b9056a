#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/scalar.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::events {

/// The event types that a hub knows because suppliers or consumers have registered them; for tools
/// without generated code.
/// @ownership owns the descriptors
class HubTypes {
 public:
  /// Queries the hub at `target`, a URL or a name.
  /// @realtime set-up only
  /// @errors   no hub answers in time; the hub is of an older release, which does not report types
  [[nodiscard]] static expected<HubTypes, SetupError> ask(
      rpc::Node& node, const std::string& target, Duration deadline = std::chrono::seconds{1});
  HubTypes(HubTypes&&) noexcept;
  HubTypes& operator=(HubTypes&&) noexcept;
  ~HubTypes();

  /// All types, ordered by number.
  [[nodiscard]] const std::vector<const EventDescriptor*>& list() const noexcept { return list_; }
  /// The descriptor of `type`; nullptr if the hub does not know it.
  [[nodiscard]] const EventDescriptor* find(EventType type) const noexcept;

 private:
  class Impl;
  explicit HubTypes(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
  std::vector<const EventDescriptor*> list_;
};

}  // namespace rtpm::events
