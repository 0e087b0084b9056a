#include "store/change_log.hpp"

#include <algorithm>
#include <utility>

#include "model/properties.hpp"
#include "model/record.hpp"

namespace rtpm::names {
namespace {

std::size_t byte_count_of(const std::shared_ptr<const Record>& record) {
  if (!record) return 0;
  return sizeof(Record) + record->name.size() + record->url.size() + record->interface.size() +
         byte_count(record->properties) + record->properties.size() * sizeof(Property);
}

// Successive changes of a name share records, so each change only counts the record that it added.
std::size_t byte_count_of(const LoggedChange& change) {
  return sizeof(LoggedChange) + byte_count_of(change.after ? change.after : change.before);
}

}  // namespace

void ChangeLog::add(LoggedChange change) {
  newest_ = change.revision;
  byte_count_ += byte_count_of(change);
  changes_.push_back(std::move(change));
  while (changes_.size() > count_max_ || (byte_count_ > byte_max_ && !changes_.empty())) {
    forgotten_ = changes_.front().revision;
    byte_count_ -= byte_count_of(changes_.front());
    changes_.pop_front();
  }
}

void ChangeLog::restart(std::uint64_t revision) {
  changes_.clear();
  byte_count_ = 0;
  newest_ = revision;
  forgotten_ = newest_;
  ++restart_count_;
}

std::size_t ChangeLog::index_after(std::uint64_t revision) const noexcept {
  const auto found = std::ranges::upper_bound(changes_, revision, {}, &LoggedChange::revision);
  return static_cast<std::size_t>(found - changes_.begin());
}

const LoggedChange* ChangeLog::after(std::uint64_t revision) const noexcept {
  const std::size_t index = index_after(revision);
  return index == changes_.size() ? nullptr : &changes_[index];
}

std::size_t ChangeLog::count_after(std::uint64_t revision) const noexcept {
  return changes_.size() - index_after(revision);
}

}  // namespace rtpm::names
