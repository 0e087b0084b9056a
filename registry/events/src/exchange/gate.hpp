#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "event_store.hpp"
#include "filter/compiled_filter.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/delivery.hpp"

namespace rtpm::events {

/// Applies a policy's decimation, interval and deadbands. Omitted events do not count as losses.
/// @ownership one pending event per interval
class Gate {
 public:
  Gate() noexcept = default;
  /// @errors   a value out of bounds; an unknown type or field of a deadband
  [[nodiscard]] static expected<Gate, SetupError> make(const DeliveryPolicy& policy,
                                                       const DescriptorSource& types);

  /// Whether to deliver now. `event` is empty for a group: deadbands ignore groups, and intervals
  /// do not defer them.
  [[nodiscard]] bool admit(const EventRef& event, MonotonicTime now) noexcept;
  /// When a deferred event is due, or earlier; kNever if there is none.
  [[nodiscard]] MonotonicTime next_time() const noexcept { return next_due_; }
  /// Takes a deferred event that is due.
  [[nodiscard]] EventRef take_held(MonotonicTime now) noexcept;
  [[nodiscard]] bool has_interval() const noexcept { return interval_ > Duration{0}; }
  /// Releases the deferred events.
  void release_events() noexcept {
    for (Interval& each : intervals_)
      each.held = EventRef();
  }
  /// Deliveries omitted.
  [[nodiscard]] std::uint64_t omitted_count() const noexcept { return omitted_count_; }

 private:
  struct Band {
    EventType type = 0;
    ScalarType field_type = ScalarType::kDouble;
    FieldPath path{};
    std::uint64_t schema_id = 0;
    Scalar default_value{};
    double threshold = 0;
  };
  /// The interval of all events or, with is_interval_per_source, of one type and source.
  struct Interval {
    EventType type = 0;
    SourceId source = 0;
    MonotonicTime next_open = MonotonicTime::min();
    EventRef held{};
  };
  /// The last delivered value of one band and source.
  struct Last {
    std::uint32_t band = 0;
    SourceId source = 0;
    double value = 0;
  };
  static constexpr std::size_t kLastCountMax = 64;

  [[nodiscard]] Interval& interval_of(const EventRef& event, MonotonicTime now) noexcept;
  [[nodiscard]] bool opens(const EventRef& event, MonotonicTime now) noexcept;
  [[nodiscard]] bool exceeds_deadband(const EventView& event) noexcept;
  [[nodiscard]] bool is_beyond(std::uint32_t band, const EventView& event) const noexcept;
  void remember(const EventView& event) noexcept;

  std::uint32_t every_nth_ = 1;
  Duration interval_{0};
  bool is_trailing_ = true;
  std::vector<Band> bands_{};
  std::vector<Last> lasts_{};  ///< Has a fixed capacity.
  std::size_t next_last_ = 0;
  std::uint32_t nth_ = 0;
  bool is_per_source_ = false;
  /// The first one is for all events; the others, with fixed capacity, serve one type and source
  /// each.
  std::vector<Interval> intervals_{};
  MonotonicTime next_due_ = kNever;
  std::uint64_t omitted_count_ = 0;
};

}  // namespace rtpm::events
