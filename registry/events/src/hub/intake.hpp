#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "hub/quota_meter.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/hub.hpp"

namespace rtpm::events {

/// The suppliers of a hub with their quotas and counters.
/// @ownership its memory, allocated at construction
class Intake {
 public:
  /// A supplier with its quota; any id is valid. A slot with tag 0 is free.
  struct Supplier {
    std::uint64_t id = 0;
    std::uint32_t tag = 0;  ///< Its supplier_tag at this hub.
    std::string name{};
    QuotaMeter meter{};
    IntakeCounters counters{};
    MonotonicTime last_heard{};
  };
  Intake(std::uint32_t supplier_count_max, const Quota& quota, std::uint64_t epoch)
      : quota_(quota), epoch_(epoch), suppliers_(std::max(supplier_count_max, 1U)) {}

  /// The supplier with this id. A new one gets a free slot, or that of the supplier silent longest.
  [[nodiscard]] Supplier& find(std::uint64_t id, MonotonicTime now) noexcept {
    Supplier* oldest = &suppliers_.front();
    for (Supplier& each : suppliers_) {
      if (each.tag != 0 && each.id == id) {
        each.last_heard = now;
        return each;
      }
      if (each.last_heard < oldest->last_heard) oldest = &each;
    }
    oldest->id = id;
    oldest->tag = supplier_tag_of(epoch_, id);
    oldest->name.clear();
    oldest->meter = QuotaMeter(quota_);
    oldest->counters = {};
    oldest->last_heard = now;
    return *oldest;
  }
  /// Whether the tag belongs to one of these suppliers.
  [[nodiscard]] bool has_tag(std::uint32_t tag) const noexcept {
    return tag != 0 && std::ranges::find(suppliers_, tag, &Supplier::tag) != suppliers_.end();
  }
  [[nodiscard]] const std::vector<Supplier>& suppliers() const noexcept { return suppliers_; }

 private:
  Quota quota_;
  std::uint64_t epoch_;
  std::vector<Supplier> suppliers_;
};

}  // namespace rtpm::events
