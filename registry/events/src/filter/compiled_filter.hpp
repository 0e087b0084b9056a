#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "event_store.hpp"
#include "filter/descriptor_source.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/filter.hpp"

namespace rtpm::events {

inline constexpr std::size_t kInterestCountMax = 64;  ///< Limit per group.

/// The events of one delivery.
/// @ownership holds its events
class Group {
 public:
  void clear() noexcept {
    while (size_ > 0)
      events_[--size_] = EventRef();
  }
  void add(EventRef event) noexcept { events_[size_++] = std::move(event); }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] const EventRef& operator[](std::size_t i) const noexcept { return events_[i]; }
  [[nodiscard]] const EventRef* begin() const noexcept { return events_.data(); }
  [[nodiscard]] const EventRef* end() const noexcept { return events_.data() + size_; }

 private:
  std::array<EventRef, kGroupSizeMax> events_{};
  std::size_t size_ = 0;
};

/// A type and source that a filter may accept; nullopt means any.
struct Interest {
  std::optional<EventType> type{};
  std::optional<SourceId> source{};
  friend bool operator==(const Interest&, const Interest&) = default;
};

/// A filter ready to run: an array of nodes, children before parents, so that a single pass
/// evaluates an event. Also holds the state of conjunctions and timeouts.
/// @ownership its nodes, allocated by compile(); references to kept events
/// @realtime alloc-free once compiled; linear in the number of nodes
class CompiledFilter {
 public:
  /// Compiles `filter`; its timeouts run from start().
  /// @errors   too deep, too many nodes or events to keep; a group without children; an unknown
  ///           type or field; an operand that does not fit the field; a timeout out of bounds, or
  ///           under "all" or "not", where it can never match
  [[nodiscard]] static expected<CompiledFilter, SetupError> compile(const Filter& filter,
                                                                    const DescriptorSource& types);

  /// Starts the timeouts.
  void start(MonotonicTime now) noexcept;

  /// Whether the event is accepted. If so, `group`, which must be empty, receives the delivery, or
  /// stays empty if the event is delivered alone.
  [[nodiscard]] bool on_event(const EventRef& event, MonotonicTime now, Group& group) noexcept;
  /// Whether a stateless filter accepts this event.
  [[nodiscard]] bool accepts(const EventHeader& header, ConstBytes payload) const noexcept;
  [[nodiscard]] bool has_timeouts() const noexcept { return !timers_.empty(); }
  /// Releases the events that conjunctions keep.
  void release_events() noexcept;

  /// When the next timeout is due; kNever if there is none.
  [[nodiscard]] MonotonicTime next_time() const noexcept;
  /// A due timeout.
  struct Due {
    std::size_t node = 0;
    std::uint32_t tag = 0;
    MonotonicTime time{};     ///< When it was due.
    std::uint64_t count = 0;  ///< Occurrences, including this one.
  };
  /// Takes and rearms the earliest due timeout; call it until nullopt.
  [[nodiscard]] std::optional<Due> take_due(MonotonicTime now) noexcept;
  /// Processes the timeout's `event` like on_event(), but fills the group even for a single event.
  [[nodiscard]] bool on_timeout(const Due& due, const EventRef& event, MonotonicTime now,
                                Group& group) noexcept;

  /// A superset of the events that it accepts.
  [[nodiscard]] const std::vector<Interest>& interests() const noexcept { return interests_; }
  /// Whether it accepts every event that matches its interests.
  [[nodiscard]] bool is_decided_by_interest() const noexcept { return is_decided_by_interest_; }

 private:
  friend class Compiler;
  using Bits = std::uint64_t;  ///< One bit for each node.
  static_assert(kFilterNodeCountMax <= 64);

  struct Node {
    Filter::Kind kind = Filter::Kind::kNull;
    Comparison comparison = Comparison::kEqual;
    ScalarType field_type = ScalarType::kDouble;
    std::uint32_t type = 0;
    std::uint32_t type_mask = 0;
    std::uint32_t source = 0;
    std::uint32_t source_mask = 0;
    FieldPath path{};
    std::uint64_t schema_id = 0;
    std::uint64_t operand_bits = 0;  ///< In the kind of the field's type, like default_bits.
    std::uint64_t default_bits = 0;
    Bits children = 0;
    std::int64_t skew_ns = 0;
    std::uint32_t kept_begin = 0;  ///< kCorrelate: index of its children in kept_.
    /// kListed: index of its matches in matches_: first those with type and source, then those with
    /// a type only, both sorted; then masked ones.
    std::uint32_t match_begin = 0;
    std::uint32_t type_begin = 0;
    std::uint32_t mask_begin = 0;
    std::uint32_t match_end = 0;
  };
  struct Timer {
    Filter::Kind kind = Filter::Kind::kOnce;
    std::size_t node = 0;
    std::size_t group = 0;  ///< The node whose delivery ends the silence.
    Duration span{};
    std::uint32_t tag = 0;
    MonotonicTime due = kNever;
    std::uint64_t count = 0;
  };
  /// The event that a conjunction keeps for one child.
  struct Kept {
    std::uint32_t child = 0;  ///< The child's node index.
    bool is_filled = false;
    Group events{};
  };

  [[nodiscard]] static bool is_match(const Node& node, const EventHeader& header) noexcept;
  [[nodiscard]] bool is_listed(const Node& node, const EventHeader& header) const noexcept;
  [[nodiscard]] static bool is_where(const Node& node, const EventHeader& header,
                                     ConstBytes payload) noexcept;
  [[nodiscard]] bool evaluate(const Node& node, Bits accepted, const EventHeader& header,
                              ConstBytes payload) const noexcept;
  [[nodiscard]] Bits judge(const EventRef& event, std::optional<std::size_t> timer) noexcept;
  [[nodiscard]] bool fill(const Node& node, Bits accepted, const EventRef& event) noexcept;
  [[nodiscard]] bool is_complete(const Node& node) const noexcept;
  [[nodiscard]] std::size_t delivered_count(std::size_t index, Bits accepted) const noexcept;
  [[nodiscard]] std::size_t delivering_child(const Node& node, Bits accepted) const noexcept;
  void collect(std::size_t index, Bits accepted, const EventRef& event,
               Group& group) const noexcept;
  [[nodiscard]] bool finish(Bits accepted, const EventRef& event, MonotonicTime now,
                            Group& group) noexcept;
  [[nodiscard]] std::span<Kept> kept_of(const Node& node) noexcept;
  [[nodiscard]] std::span<const Kept> kept_of(const Node& node) const noexcept;

  // Frequently used members first.
  std::vector<Node> nodes_{};
  bool is_stateless_ = true;
  std::vector<Match> matches_{};
  std::vector<Timer> timers_{};
  std::vector<Kept> kept_{};
  std::vector<Interest> interests_{};
  bool is_decided_by_interest_ = false;
};

}  // namespace rtpm::events
