#include "events/change_finder.hpp"
#include "rtpm/driver/vector.hpp"

#include <algorithm>

namespace rtpm::gvd {
namespace {

using driver::Fault;
using driver::Faults;

/// The most edges reported for one button between two records; the last ones are reported.
constexpr std::uint16_t kEdgeCountMax = 8;

}  // namespace

std::span<const CycleChange> ChangeFinder::step(const CycleRecord& record) {
  changes_.clear();
  const CycleRecord before = last_.value_or(CycleRecord{});
  if (before.sample.lifecycle != record.sample.lifecycle) {
    changes_.emplace_back(LifecycleChange{before.sample.lifecycle, record.sample.lifecycle});
  }
  find_lease(before, record);
  find_faults(before.sample.faults, record.sample.faults);
  // The first record has no predecessor: buttons that were already pressed are not reported.
  if (last_) find_buttons(before.sample, record.sample);
  find_contact(record.sample);
  last_ = record;
  return changes_;
}

void ChangeFinder::find_buttons(const driver::Sample& before, const driver::Sample& after) {
  for (std::size_t button = 0; button < driver::kButtonCountMax; ++button) {
    const auto edge_count =
        static_cast<std::uint16_t>(after.button_edges[button] - before.button_edges[button]);
    const bool is_pressed = (after.buttons >> button & 1U) != 0;
    for (std::uint16_t left = std::min(edge_count, kEdgeCountMax); left > 0; --left) {
      changes_.emplace_back(ButtonChange{button, (left % 2 == 1) == is_pressed});
    }
  }
}

void ChangeFinder::find_contact(const driver::Sample& sample) {
  const double force_newton = length(sample.wrench_applied.force_newton);
  const double limit_newton = is_touching_ ? contact_force_newton_ / 2 : contact_force_newton_;
  const bool is_touching = force_newton >= limit_newton;
  if (is_touching == is_touching_) return;
  is_touching_ = is_touching;
  changes_.emplace_back(ContactChange{is_touching, force_newton});
}

void ChangeFinder::find_faults(Faults before, Faults after) {
  const Faults begun{after.bits() & ~before.bits()};
  const Faults ended{before.bits() & ~after.bits()};
  if (begun.has(Fault::kEmergencyStop)) changes_.emplace_back(StopChange{true});
  if (ended.has(Fault::kEmergencyStop)) changes_.emplace_back(StopChange{false});
  if (!begun.empty() || !ended.empty()) changes_.emplace_back(FaultChange{begun, ended});
}

void ChangeFinder::find_lease(const CycleRecord& before, const CycleRecord& after) {
  if (before.is_held == after.is_held && before.lease_serial == after.lease_serial) return;
  if (before.is_held) changes_.emplace_back(LeaseChange{after.last_end});
  if (after.is_held) changes_.emplace_back(LeaseChange{LeaseState::kHeld});
}

}  // namespace rtpm::gvd
