#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "event_store.hpp"
#include "filter/descriptor_source.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/events/filter.hpp"

namespace rtpm::events {

inline constexpr std::size_t kInterestCountMax = 64;  ///< Of a group.

/// Why a filter was refused: one sentence that names the node, by its place in the tree, and the
/// field.
struct FilterError {
  std::string text;
};

/// What a filter delivers at a time.
/// @ownership holds its events
/// @realtime alloc-free
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

/// Events that a program may accept: of this type, of any type; from this source, or any.
struct Interest {
  std::optional<EventType> type{};
  std::optional<SourceId> source{};
  friend bool operator==(const Interest&, const Interest&) = default;
};

/// A filter as it runs: its nodes one after the other, children before parents, so that one pass
/// over them judges an event. Holds what conjunctions keep and when timeouts are due.
/// @ownership its nodes, allocated when compiled; references to the events it keeps
/// @threads  one at a time
/// @realtime alloc-free once compiled; linear in the number of nodes
class CompiledFilter {
 public:
  /// Compiles `filter`; its timeouts begin at start().
  /// @realtime set-up only
  /// @errors   too deep, too many nodes or events to keep; a group without children; a predicate's
  ///           type or field that nobody knows, or an operand that the field can't be; a timeout
  ///           out of bounds, or under "all" or "not", where no event ever meets it
  [[nodiscard]] static expected<CompiledFilter, FilterError> compile(const Filter& filter,
                                                                     const DescriptorSource& types);

  /// Sets the timeouts going.
  void start(MonotonicTime now) noexcept;

  /// Whether the event is accepted. Then `group`, which is empty before, has what is delivered; it
  /// is left empty for the plain case: the event alone.
  [[nodiscard]] bool on_event(const EventRef& event, MonotonicTime now, Group& group) noexcept;
  /// The same for a program that keeps nothing and has no timeouts.
  [[nodiscard]] bool accepts(const EventHeader& header, ConstBytes payload) const noexcept;
  [[nodiscard]] bool is_stateless() const noexcept { return is_stateless_; }
  [[nodiscard]] bool has_timeouts() const noexcept { return !timers_.empty(); }
  /// Gives up the events that conjunctions keep.
  void release_events() noexcept;

  /// When the next timeout is due, kNever if none will be.
  [[nodiscard]] MonotonicTime next_time() const noexcept;
  /// A timeout that is due.
  struct Due {
    std::size_t node = 0;
    std::uint32_t tag = 0;
    MonotonicTime time{};     ///< When it was due.
    std::uint64_t count = 0;  ///< How often it came, this time included.
  };
  /// The earliest timeout that is due by now, and sets it for the next time; call until there is
  /// none.
  [[nodiscard]] std::optional<Due> take_due(MonotonicTime now) noexcept;
  /// Lets the timeout act, with `event` standing for it. As on_event(), but the group is always
  /// filled in.
  [[nodiscard]] bool on_timeout(const Due& due, const EventRef& event, MonotonicTime now,
                                Group& group) noexcept;

  /// The events it is to be shown; one more would do no harm, one less would.
  [[nodiscard]] const std::vector<Interest>& interests() const noexcept { return interests_; }
  /// Whether every event that is of its interests is accepted.
  [[nodiscard]] bool is_decided_by_interest() const noexcept { return is_decided_by_interest_; }

 private:
  friend class Compiler;
  using Bits = std::uint64_t;  ///< One for each node.
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
    std::uint64_t operand_bits = 0;  ///< Of the kind that the field's type has, as is the default.
    std::uint64_t default_bits = 0;
    Bits children = 0;
    std::int64_t skew_ns = 0;
    std::uint32_t kept_begin = 0;  ///< kCorrelate: its children's places in kept_.
    /// kListed: its matches' places in matches_: first those of one type and source, then those of
    /// one type, both in order; then the others.
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
  /// What a conjunction keeps of one child.
  struct Kept {
    std::uint32_t child = 0;  ///< A node.
    bool is_filled = false;
    Group events{};
  };

  [[nodiscard]] static bool is_match(const Node& node, const EventHeader& header) noexcept;
  [[nodiscard]] bool is_listed(const Node& node, const EventHeader& header) const noexcept;
  [[nodiscard]] static bool is_where(const Node& node, const EventHeader& header,
                                     ConstBytes payload) noexcept;
  [[nodiscard]] Bits judge(const EventRef& event, std::optional<std::size_t> timer) noexcept;
  [[nodiscard]] bool fill(const Node& node, Bits accepted, const EventRef& event) noexcept;
  [[nodiscard]] bool is_complete(const Node& node) const noexcept;
  void collect(std::size_t index, Bits accepted, const EventRef& event,
               Group& group) const noexcept;
  [[nodiscard]] bool finish(Bits accepted, const EventRef& event, MonotonicTime now,
                            Group& group) noexcept;
  [[nodiscard]] std::span<Kept> kept_of(const Node& node) noexcept;
  [[nodiscard]] std::span<const Kept> kept_of(const Node& node) const noexcept;

  // What every event needs, first.
  std::vector<Node> nodes_{};
  bool is_stateless_ = true;
  std::vector<Match> matches_{};
  std::vector<Timer> timers_{};
  std::vector<Kept> kept_{};
  std::vector<Interest> interests_{};
  bool is_decided_by_interest_ = false;
};

}  // namespace rtpm::events
