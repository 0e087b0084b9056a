#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <touch.rtpm.events.hpp>

#include "god_object.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/typed.hpp"
#include "rtpm/rpc/node.hpp"

/// Touches as events, from the force node to any number of graphics nodes.
namespace rtpm::scene {

/// One cycle of the force loop.
struct TouchReport {
  std::uint64_t cycle = 0;  ///< Sample::sequence of the sample it was computed from.
  Scene scene{};
  Touch touch{};
};

[[nodiscard]] touch::State to_wire(const TouchReport& report) noexcept;
/// @return  nullopt for an unknown shape, an invalid position, or an implausible force
[[nodiscard]] std::optional<TouchReport> from_wire(const touch::State& state) noexcept;

/// The source of a device's touches.
[[nodiscard]] events::SourceId touch_source_of(std::string_view device) noexcept;

/// Pushes the touches of a device to a hub.
/// @ownership refers to its node, which must outlive it
/// @threads  one at a time
class TouchSupplier {
 public:
  /// @param hub  a name or a URL
  /// @realtime set-up only
  /// @errors   no hub answers
  [[nodiscard]] static expected<TouchSupplier, SetupError> create(rpc::Node& node,
                                                                  const std::string& hub,
                                                                  std::string_view device);

  /// Adds a touch to the batch for the next flush(). A touch that can't be sent is lost.
  /// @realtime alloc-free; one send if the batch is full
  void add(const TouchReport& report) noexcept;
  /// Sends the batch.
  /// @realtime alloc-free; one send
  void flush() noexcept;

 private:
  using Supplier = events::TypedSupplier<touch::TouchedEvent>;
  explicit TouchSupplier(Supplier supplier) noexcept : supplier_(std::move(supplier)) {}
  Supplier supplier_;
};

}  // namespace rtpm::scene
