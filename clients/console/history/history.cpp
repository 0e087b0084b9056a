#include "history/history.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace rtpm::console {
namespace {

constexpr std::int64_t kChunk = FieldHistory::kChunkSize;
/// A topic without values for this long gives way to a new one.
constexpr std::int64_t kIdleNs = 60'000'000'000;
/// A clock that is corrected by less keeps the past as it is.
constexpr std::int64_t kSetBackMinNs = 1'000'000'000;
/// The map's node and the vectors' headers of a topic, roughly.
constexpr std::size_t kTopicByteCount = 256;
constexpr std::size_t kGrowthCount = 4;
constexpr std::size_t kSmallByteCount = 4096;

std::int64_t floor_div(std::int64_t value, std::int64_t by) noexcept {
  return value / by - (value % by < 0 ? 1 : 0);
}

HistorySpan joined(HistorySpan a, HistorySpan b) noexcept {
  return {std::min(a.low, b.low), std::max(a.high, b.high)};
}

bool is_same(HistorySpan a, HistorySpan b) noexcept {
  return a.low == b.low && a.high == b.high;
}

char lower(char letter) noexcept {
  return letter >= 'A' && letter <= 'Z' ? static_cast<char>(letter - 'A' + 'a') : letter;
}

bool contains_word(std::string_view text, std::string_view word) noexcept {
  return !std::ranges::search(text, word, {}, lower, lower).empty();
}

/// The words of a query, which must outlive them.
std::vector<std::string_view> words_of(std::string_view query) {
  std::vector<std::string_view> words;
  while (!query.empty()) {
    const std::size_t end = std::min(query.find(' '), query.size());
    if (end > 0) words.push_back(query.substr(0, end));
    query.remove_prefix(std::min(end + 1, query.size()));
  }
  return words;
}

std::pair<std::string_view, std::string_view> split_path(std::string_view path) noexcept {
  const std::size_t slash = path.rfind('/');
  const std::size_t dot = path.find('.', slash == std::string_view::npos ? 0 : slash);
  if (slash != std::string_view::npos && dot != std::string_view::npos) {
    return {path.substr(0, dot), path.substr(dot + 1)};
  }
  return {path, {}};
}

}  // namespace

void FieldHistory::put(std::int64_t time_ns, double value) {
  const auto single = static_cast<float>(value);
  if (!std::isfinite(single)) return;
  const std::int64_t step = floor_div(time_ns, kHistoryTiers[0].step_ns);
  if (open_ && step != open_step_) flush();
  open_step_ = step;
  open_ = open_ ? joined(*open_, {single, single}) : HistorySpan{single, single};
}

void FieldHistory::flush() {
  if (!open_) return;
  for (std::size_t tier = 0; tier < kHistoryTiers.size(); ++tier) {
    const std::int64_t ratio = kHistoryTiers[tier].step_ns / kHistoryTiers[0].step_ns;
    merge(tier, floor_div(open_step_, ratio), *open_);
  }
  open_.reset();
}

void FieldHistory::merge(std::size_t tier, std::int64_t step, HistorySpan span) {
  std::vector<Chunk>& chunks = tiers_[tier];
  const std::int64_t number = floor_div(step, kChunk);
  const auto later = std::ranges::lower_bound(chunks, number, {}, &Chunk::number);
  Chunk* chunk = later != chunks.end() && later->number == number ? &*later : nullptr;
  if (chunk == nullptr) {
    // One more than is kept, because the newest is not full.
    const std::size_t count_max = kHistoryTiers[tier].step_count / kChunkSize + 1;
    if (chunks.size() >= count_max) {
      if (later == chunks.begin()) return;  // Older than all that is kept.
      if (chunks.front().spans) --span_count_;
      const auto at = later - chunks.begin() - 1;
      chunks.erase(chunks.begin());
      chunk = &*chunks.insert(chunks.begin() + at, Chunk{.number = number});
    } else {
      const auto at = later - chunks.begin();
      if (chunks.size() == chunks.capacity()) chunks.reserve(chunks.size() + kGrowthCount);
      chunk = &*chunks.insert(chunks.begin() + at, Chunk{.number = number});
    }
  }
  const auto place = static_cast<std::size_t>(step - number * kChunk);
  if (!chunk->spans) {
    if (chunk->present.none()) chunk->same = span;
    if (is_same(chunk->same, span)) {
      chunk->present.set(place);
      return;
    }
    chunk->spans = std::make_unique<std::array<HistorySpan, kChunkSize>>();
    chunk->spans->fill(chunk->same);
    ++span_count_;
  }
  HistorySpan& kept = (*chunk->spans)[place];
  kept = chunk->present[place] ? joined(kept, span) : span;
  chunk->present.set(place);
}

void FieldHistory::forget_after(std::int64_t time_ns) {
  flush();
  for (std::size_t tier = 0; tier < kHistoryTiers.size(); ++tier) {
    const std::int64_t last = floor_div(time_ns, kHistoryTiers[tier].step_ns);
    std::vector<Chunk>& chunks = tiers_[tier];
    while (!chunks.empty() && chunks.back().number * kChunk > last) {
      if (chunks.back().spans) --span_count_;
      chunks.pop_back();
    }
    if (chunks.empty()) continue;
    for (std::int64_t place = last - chunks.back().number * kChunk + 1; place < kChunk; ++place)
      chunks.back().present.reset(static_cast<std::size_t>(place));
  }
}

void FieldHistory::clear() {
  *this = FieldHistory();
}

std::size_t FieldHistory::byte_count() const noexcept {
  std::size_t count = span_count_ * sizeof(std::array<HistorySpan, kChunkSize>);
  for (const std::vector<Chunk>& chunks : tiers_)
    count += chunks.capacity() * sizeof(Chunk);
  return count;
}

std::size_t History::size_of(const Entry& entry) noexcept {
  return sizeof entry + entry.field.name.capacity() + entry.field.unit.capacity() +
         entry.past.byte_count();
}

bool History::make_room(std::size_t topic_count, std::size_t field_count) {
  while (topics_.size() + topic_count > limits_.topic_max ||
         field_count_ + field_count > limits_.field_max) {
    const auto oldest =
        std::ranges::min_element(topics_, {}, [](const auto& one) { return one.second.fed_ns; });
    if (oldest == topics_.end() || now_ns_ - oldest->second.fed_ns < kIdleNs) return false;
    forget(oldest);
  }
  return true;
}

void History::forget(std::map<std::string, Topic, std::less<>>::iterator topic) {
  byte_count_ -= kTopicByteCount;
  field_count_ -= topic->second.entries.size();
  for (const Entry& entry : topic->second.entries) {
    byte_count_ -= size_of(entry);
    if (entry.is_dropped) --dropped_count_;
  }
  topics_.erase(topic);
}

bool History::add(const HistoryTopic& topic) {
  std::vector<Entry> before;
  std::int64_t fed_ns = now_ns_;
  if (const auto known = topics_.find(topic.name); known != topics_.end()) {
    fed_ns = known->second.fed_ns;
    byte_count_ -= kTopicByteCount;
    field_count_ -= known->second.entries.size();
    for (const Entry& entry : known->second.entries) {
      byte_count_ -= size_of(entry);
      if (entry.is_dropped) --dropped_count_;
    }
    before = std::move(known->second.entries);
    topics_.erase(known);
  }
  if (!make_room(1, topic.fields.size())) {
    ++refused_count_;
    return false;
  }
  Topic& made = topics_[topic.name];
  made.device = topic.device;
  made.fed_ns = fed_ns;
  made.entries.reserve(topic.fields.size());
  for (const HistoryField& field : topic.fields) {
    const auto kept = std::ranges::find_if(
        before, [&](const Entry& entry) { return entry.field.name == field.name; });
    Entry& entry = made.entries.emplace_back();
    if (kept != before.end()) entry = std::move(*kept);
    entry.field = field;
    byte_count_ += size_of(entry);
    if (entry.is_dropped) ++dropped_count_;
  }
  byte_count_ += kTopicByteCount;
  field_count_ += topic.fields.size();
  while (byte_count_ > limits_.byte_max && dropped_count_ < field_count_)
    drop_least_used();
  return true;
}

bool History::has(const HistoryTopic& topic) const {
  const auto found = topics_.find(topic.name);
  return found != topics_.end() && std::ranges::equal(
                                       found->second.entries, topic.fields, {},
                                       [](const Entry& entry) { return entry.field.name; },
                                       [](const HistoryField& field) { return field.name; });
}

bool History::put(std::string_view topic, std::int64_t time_ns, std::span<const double> values) {
  const auto found = topics_.find(topic);
  if (found == topics_.end() || found->second.entries.size() != values.size()) return false;
  found->second.fed_ns = std::max(found->second.fed_ns, now_ns_);
  if (time_ns > now_ns_ + kFutureMaxNs) {
    ++future_count_;
    return true;
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    Entry& entry = found->second.entries[i];
    if (entry.is_dropped) continue;
    const std::size_t before = entry.past.byte_count();
    entry.past.put(time_ns, values[i]);
    byte_count_ += entry.past.byte_count() - before;
    while (byte_count_ > limits_.byte_max && dropped_count_ < field_count_)
      drop_least_used();
  }
  return true;
}

void History::set_now(std::int64_t now_ns) {
  const bool is_set_back = now_ns < now_ns_ - kSetBackMinNs;
  now_ns_ = now_ns;
  if (!is_set_back) return;
  for (auto& [name, topic] : topics_) {
    topic.fed_ns = std::min(topic.fed_ns, now_ns);
    for (Entry& entry : topic.entries) {
      byte_count_ -= size_of(entry);
      entry.past.forget_after(now_ns);
      byte_count_ += size_of(entry);
    }
  }
}

void History::drop_least_used() {
  Entry* least = nullptr;
  std::tuple<bool, std::uint64_t, std::int64_t> least_use{};
  for (auto& [name, topic] : topics_) {
    for (Entry& entry : topic.entries) {
      // One whose value never changed is small: dropping it would free next to nothing.
      const std::tuple use{entry.past.byte_count() < kSmallByteCount, entry.asked, topic.fed_ns};
      if (entry.is_dropped || (least != nullptr && use >= least_use)) continue;
      least = &entry;
      least_use = use;
    }
  }
  if (least == nullptr) return;
  byte_count_ -= size_of(*least);
  least->past.clear();
  least->is_dropped = true;
  byte_count_ += size_of(*least);
  ++dropped_count_;
}

History::Search History::find(std::string_view query, std::size_t count_max) const {
  Search search;
  const std::vector<std::string_view> words = words_of(query);
  for (const auto& [name, topic] : topics_) {
    for (const Entry& entry : topic.entries) {
      const std::string path = name + "." + entry.field.name;
      const bool is_found = std::ranges::all_of(
          words, [&](std::string_view word) { return contains_word(path, word); });
      if (!is_found || ++search.total_count > count_max) continue;
      search.fields.push_back({path, entry.field.unit, topic.device});
    }
  }
  return search;
}

History::Entry* History::entry_of(std::string_view path) {
  const auto [name, field] = split_path(path);
  const auto topic = topics_.find(name);
  if (topic == topics_.end()) return nullptr;
  const auto entry = std::ranges::find_if(
      topic->second.entries, [&](const Entry& one) { return one.field.name == field; });
  return entry == topic->second.entries.end() ? nullptr : &*entry;
}

std::optional<HistoryColumn> History::read(std::string_view path, std::int64_t begin_ns,
                                           std::int64_t end_ns, std::size_t point_max) {
  Entry* const entry = entry_of(path);
  if (entry == nullptr) return std::nullopt;
  entry->asked = ++ask_count_;
  if (entry->is_dropped) {
    entry->is_dropped = false;
    --dropped_count_;
  }
  const std::int64_t point_count = std::max<std::int64_t>(1, static_cast<std::int64_t>(point_max));
  std::size_t tier = 0;
  const auto suits = [&](const HistoryTier& one) {
    const std::int64_t reach = one.step_ns * static_cast<std::int64_t>(one.step_count);
    return begin_ns >= now_ns_ - reach && (end_ns - begin_ns) / one.step_ns <= point_count;
  };
  while (tier + 1 < kHistoryTiers.size() && !suits(kHistoryTiers[tier]))
    ++tier;
  const std::int64_t step_ns = kHistoryTiers[tier].step_ns;
  const std::int64_t begin = floor_div(begin_ns, step_ns);
  const std::int64_t end = floor_div(end_ns, step_ns) + 1;
  // Steps that are merged begin at multiples of their length, so that they are the same each time.
  const std::int64_t merged = (end - begin + point_count - 1) / point_count;
  HistoryColumn column{.unit = entry->field.unit, .step_ns = step_ns * merged};
  byte_count_ -= size_of(*entry);
  entry->past.visit(tier, begin, end, [&](std::int64_t step, HistorySpan span) {
    const std::int64_t time_ns = floor_div(step, merged) * column.step_ns;
    if (!column.times_ns.empty() && column.times_ns.back() == time_ns) {
      column.spans.back() = joined(column.spans.back(), span);
    } else {
      column.times_ns.push_back(time_ns);
      column.spans.push_back(span);
    }
  });
  byte_count_ += size_of(*entry);
  return column;
}

}  // namespace rtpm::console
