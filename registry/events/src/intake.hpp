#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/events/hub.hpp"
#include "rtpm/events/quota.hpp"

namespace rtpm::events {

/// The suppliers of a hub: what each may push, and what became of it.
/// Ownership: its memory, taken when built.   Threads: one at a time.
class Intake {
 public:
  /// A supplier; id 0: the place is free.
  struct Supplier {
    std::uint64_t id = 0;
    std::string name{};
    QuotaMeter meter{};
    IntakeCounters counters{};
    MonotonicTime last_heard{};
  };
  Intake(std::uint32_t supplier_count_max, const Quota& quota)
      : quota_(quota), suppliers_(std::max(supplier_count_max, 1U)) {}

  /// The supplier with this id, which is new if nobody has heard of it: then it takes the place of
  /// the one that was silent longest, if none is free.   RT: alloc-free.
  [[nodiscard]] Supplier& find(std::uint64_t id, MonotonicTime now) noexcept {
    Supplier* oldest = &suppliers_.front();
    for (Supplier& each : suppliers_) {
      if (each.id == id) {
        each.last_heard = now;
        return each;
      }
      if (each.last_heard < oldest->last_heard) oldest = &each;
    }
    oldest->id = id;
    oldest->name.clear();
    oldest->meter = QuotaMeter(quota_);
    oldest->counters = {};
    oldest->last_heard = now;
    return *oldest;
  }
  [[nodiscard]] const std::vector<Supplier>& suppliers() const noexcept { return suppliers_; }

 private:
  Quota quota_;
  std::vector<Supplier> suppliers_;
};

}  // namespace rtpm::events
