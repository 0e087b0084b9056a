#pragma once

#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "rtpm/gvd/device_event.hpp"
#include "rtpm/gvd/observer.hpp"

namespace rtpm::gvd {

using CycleChange = std::variant<ButtonChange, ContactChange, LifecycleChange, FaultChange,
                                 LeaseChange, StopChange>;

/// Finds the changes between two records of a device. Uses no clock and no thread.
/// @ownership a value
class ChangeFinder {
 public:
  /// Contact starts at `contact_force_newton` and ends below half of it.
  explicit ChangeFinder(double contact_force_newton) noexcept
      : contact_force_newton_(contact_force_newton) {}

  /// The changes since the last record, which may be several cycles old; valid until the next call.
  /// The first record is compared with an unconfigured device.
  /// @realtime allocates until its memory suffices
  [[nodiscard]] std::span<const CycleChange> step(const CycleRecord& record);

 private:
  void find_buttons(const driver::Sample& before, const driver::Sample& after);
  void find_contact(const driver::Sample& sample);
  void find_faults(driver::Faults before, driver::Faults after);
  void find_lease(const CycleRecord& before, const CycleRecord& after);

  double contact_force_newton_;
  std::optional<CycleRecord> last_{};
  bool is_touching_ = false;
  std::vector<CycleChange> changes_{};
};

}  // namespace rtpm::gvd
