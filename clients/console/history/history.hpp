#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::console {

/// A step of the past: the lowest and highest value of each interval.
struct HistoryTier {
  std::int64_t step_ns = 0;
  std::size_t step_count = 0;  ///< How many steps are kept.
};
/// 90 s by 0.1 s, 20 minutes by 1 s, 4 hours by 10 s: 33 kB of a field.
inline constexpr std::array<HistoryTier, 3> kHistoryTiers{
    {{100'000'000, 900}, {1'000'000'000, 1200}, {10'000'000'000, 1440}}};

struct HistorySpan {
  float low = 0;
  float high = 0;
};

/// The past of one number in all tiers. Steps whose values are all equal share one value.
/// @threads  one
class FieldHistory {
 public:
  /// Steps are allocated in chunks of this many.
  static constexpr std::size_t kChunkSize = 60;

  /// Ignores NaN and infinities.
  void put(std::int64_t time_ns, double value);
  /// Forgets what lies after `time_ns`, because the clock was set back.
  void forget_after(std::int64_t time_ns);
  void clear();
  /// Calls `visit(std::int64_t step, HistorySpan)` for the steps of a tier from `begin` up to before
  /// `end`, both as multiples of the tier's step, in order.
  template <class Visit>
  void visit(std::size_t tier, std::int64_t begin, std::int64_t end, const Visit& visit);
  [[nodiscard]] std::size_t byte_count() const noexcept;

 private:
  /// Consecutive steps of a tier.
  struct Chunk {
    std::int64_t number = 0;  ///< Its first step divided by kChunkSize.
    std::bitset<kChunkSize> present{};
    HistorySpan same{};  ///< Every present step, if `spans` is null.
    std::unique_ptr<std::array<HistorySpan, kChunkSize>> spans{};
  };

  void flush();
  void merge(std::size_t tier, std::int64_t step, HistorySpan span);

  std::array<std::vector<Chunk>, kHistoryTiers.size()> tiers_{};  ///< Each by number.
  std::int64_t open_step_ = 0;  ///< The step of the finest tier that `open_` belongs to.
  std::optional<HistorySpan> open_{};
  std::size_t span_count_ = 0;  ///< Chunks with `spans`.
};

struct HistoryField {
  std::string name{};  ///< "position_m.x".
  std::string unit{};
};

/// A source of numbers: the events of a type and source, or the parameters of an object.
struct HistoryTopic {
  std::string name{};    ///< "lab/arm0/sampled", as in recordings.
  std::string device{};  ///< "lab/arm0"; empty if no device is known for it.
  std::vector<HistoryField> fields{};
};

/// The lowest and highest values of a field over time.
struct HistoryColumn {
  std::string unit{};
  std::int64_t step_ns = 0;
  std::vector<std::int64_t> times_ns{};  ///< The beginning of each step with values.
  std::vector<HistorySpan> spans{};
};

/// Keeps the recent past of all numbers within a fixed amount of memory. If it is used up, the past
/// of a field is dropped, and not recorded until it is asked for: first of the field that was asked
/// for the longest ago or never, among those of the one without new values for the longest time.
/// @threads  one
class History {
 public:
  struct Limits {
    std::size_t byte_max = std::size_t{48} << 20;
    std::size_t topic_max = 4096;
    std::size_t field_max = 16384;
  };
  /// A value whose time is later than now() by more than this is refused.
  static constexpr std::int64_t kFutureMaxNs = 5'000'000'000;

  History() : History(Limits()) {}
  explicit History(Limits limits) noexcept : limits_(limits) {}

  /// Adds or replaces a topic; fields of the same name keep their past. If there are too many,
  /// topics without values for a minute are forgotten first.
  /// @return   whether there is room for it
  bool add(const HistoryTopic& topic);
  /// Whether there is a topic of this name with these fields, in this order.
  [[nodiscard]] bool has(const HistoryTopic& topic) const;
  /// Stores one value of each field; NaN means none.
  /// @return   whether the topic is known, with this many fields
  bool put(std::string_view topic, std::int64_t time_ns, std::span<const double> values);
  /// Sets the wall clock's time. Values after it by more than the tolerance are forgotten,
  /// because the clock was set back.
  void set_now(std::int64_t now_ns);

  struct Found {
    std::string path{};  ///< "lab/arm0/sampled.position_m.x".
    std::string unit{};
    std::string device{};
  };
  struct Search {
    std::vector<Found> fields{};
    std::size_t total_count = 0;  ///< Also those beyond the limit.
  };
  /// The fields whose paths contain all words of `query`, in any case, in order of their paths.
  [[nodiscard]] Search find(std::string_view query, std::size_t count_max) const;
  /// Reads a field in the finest tier that reaches back to `begin_ns` with at most `point_max`
  /// steps; the coarsest one's steps are merged to that count.
  /// @return   nullopt if there is no such field
  [[nodiscard]] std::optional<HistoryColumn> read(std::string_view path, std::int64_t begin_ns,
                                                  std::int64_t end_ns, std::size_t point_max);

  [[nodiscard]] std::size_t byte_count() const noexcept { return byte_count_; }
  [[nodiscard]] std::size_t byte_max() const noexcept { return limits_.byte_max; }
  [[nodiscard]] std::size_t field_count() const noexcept { return field_count_; }
  /// The fields whose past is not recorded because of the memory.
  [[nodiscard]] std::size_t dropped_count() const noexcept { return dropped_count_; }
  /// How often a topic was refused because there are too many.
  [[nodiscard]] std::uint64_t refused_count() const noexcept { return refused_count_; }
  /// How many times of values were in the future.
  [[nodiscard]] std::uint64_t future_count() const noexcept { return future_count_; }

 private:
  struct Entry {
    HistoryField field{};
    FieldHistory past{};
    std::uint64_t asked = 0;  ///< The number of the newest read(); 0: never.
    bool is_dropped = false;
  };
  struct Topic {
    std::string device{};
    std::vector<Entry> entries{};
    std::int64_t fed_ns = 0;  ///< The newest put().
  };

  [[nodiscard]] static std::size_t size_of(const Entry& entry) noexcept;
  bool make_room(std::size_t topic_count, std::size_t field_count);
  void forget(std::map<std::string, Topic, std::less<>>::iterator topic);
  void drop_least_used();
  [[nodiscard]] Entry* entry_of(std::string_view path);

  Limits limits_;
  std::map<std::string, Topic, std::less<>> topics_{};
  std::int64_t now_ns_ = 0;
  std::size_t byte_count_ = 0;
  std::size_t field_count_ = 0;
  std::size_t dropped_count_ = 0;
  std::uint64_t refused_count_ = 0;
  std::uint64_t future_count_ = 0;
  std::uint64_t ask_count_ = 0;
};

template <class Visit>
void FieldHistory::visit(std::size_t tier, std::int64_t begin, std::int64_t end,
                         const Visit& visit) {
  flush();
  for (const Chunk& chunk : tiers_[tier]) {
    const std::int64_t first = chunk.number * static_cast<std::int64_t>(kChunkSize);
    for (std::size_t i = 0; i < kChunkSize; ++i) {
      const std::int64_t step = first + static_cast<std::int64_t>(i);
      if (step < begin || step >= end || !chunk.present[i]) continue;
      visit(step, chunk.spans ? (*chunk.spans)[i] : chunk.same);
    }
  }
}

}  // namespace rtpm::console
