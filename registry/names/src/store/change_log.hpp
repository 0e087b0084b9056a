#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>

namespace rtpm::names {

struct Record;

/// One change of a name: the previous and the new record; null if not bound.
struct LoggedChange {
  std::uint64_t revision = 0;
  std::shared_ptr<const Record> before{};
  std::shared_ptr<const Record> after{};
};

/// The latest changes, ordered by revision, bounded by number and bytes.
/// @threads  one at a time
class ChangeLog {
 public:
  /// `revision`: the last change before the log's first one.
  ChangeLog(std::size_t count_max, std::size_t byte_max, std::uint64_t revision) noexcept
      : count_max_(count_max), byte_max_(byte_max), forgotten_(revision), newest_(revision) {}

  /// Drops the oldest changes beyond the bounds.
  void add(LoggedChange change);
  /// Whether the log still has every change after `revision`; false also for a future revision.
  [[nodiscard]] bool reaches(std::uint64_t revision) const noexcept {
    return revision >= forgotten_ && revision <= newest_;
  }
  /// The first change after `revision`; null if there is none yet.
  [[nodiscard]] const LoggedChange* after(std::uint64_t revision) const noexcept;
  /// How many changes there are after `revision`.
  [[nodiscard]] std::size_t count_after(std::uint64_t revision) const noexcept;
  /// Revision of the last change.
  [[nodiscard]] std::uint64_t revision() const noexcept { return newest_; }
  /// Drops all changes. `revision` may be lower than before; changes up to it are no longer known
  /// individually.
  void restart(std::uint64_t revision);
  /// The number of calls of restart().
  [[nodiscard]] std::uint64_t restart_count() const noexcept { return restart_count_; }

 private:
  [[nodiscard]] std::size_t index_after(std::uint64_t revision) const noexcept;

  std::size_t count_max_;
  std::size_t byte_max_;
  std::size_t byte_count_ = 0;
  std::uint64_t forgotten_;  ///< The newest dropped revision.
  std::uint64_t newest_;
  std::uint64_t restart_count_ = 0;
  std::deque<LoggedChange> changes_{};
};

}  // namespace rtpm::names
