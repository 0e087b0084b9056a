#pragma once

#include <cstdint>
#include <optional>

#include "mailbox.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/command_lease.hpp"
#include "rtpm/gvd/error.hpp"
#include "rtpm/models/check.hpp"
#include "rtpm/models/evaluator.hpp"

namespace rtpm::gvd {

/// Why a list of models was refused; `error` is set for kOutOfRange.
struct ModelsRefusal {
  DeviceOutcome outcome = DeviceOutcome::kDone;
  std::optional<ModelError> error{};
};

/// A list of models from a client.
struct ClientModels {
  std::uint64_t lease = 0;
  std::uint32_t sequence = 0;
  ModelList list{};
};

/// The models of a lease: any thread sets the newest list, the device's thread computes its forces.
/// @ownership a value
/// @threads  limits() and put() from any, the rest from the device's
/// @realtime alloc-free; put() is lock-free, the rest wait-free
class LocalModels {
 public:
  LocalModels(const driver::Descriptor& descriptor, Duration period) noexcept
      : limits_(ModelLimits::for_device(descriptor, period)) {}

  [[nodiscard]] const ModelLimits& limits() const noexcept { return limits_; }
  /// Stores a checked list for the next cycle. `is_after_release`: the holder's release request
  /// came before, so it does not end this list.
  template <class Allowed>
  [[nodiscard]] MailOutcome put(MailStamp stamp, const ClientModels& models, bool is_after_release,
                                Allowed is_allowed) noexcept {
    return mailbox_.put(stamp, {models.lease, is_after_release, models.list}, is_allowed);
  }

  /// Takes the newest list, but drops it unless `holder` set it.
  void take_for(std::uint64_t holder) noexcept;
  /// Drops the list, unless it was set after the release request.
  void drop_before_release() noexcept;
  void drop() noexcept;
  [[nodiscard]] bool is_empty() const noexcept { return evaluator_.is_empty(); }
  /// The list that is rendered.
  [[nodiscard]] const ModelList& list() const noexcept { return evaluator_.list(); }
  /// Changes with every list.
  [[nodiscard]] std::uint64_t revision() const noexcept { return revision_; }
  [[nodiscard]] ModelForces evaluate(const driver::Sample& sample) noexcept {
    return evaluator_.evaluate(sample);
  }

 private:
  struct HeldList {
    std::uint64_t lease = Lease::kNobody;
    bool is_after_release = false;
    ModelList list{};
  };

  void hold(const HeldList& list) noexcept;
  void clear() noexcept;

  ModelLimits limits_;
  Mailbox<HeldList> mailbox_{};
  std::uint64_t lease_ = Lease::kNobody;  ///< The lease of the evaluator's list.
  std::uint64_t revision_ = 0;
  Evaluator evaluator_{};
};

}  // namespace rtpm::gvd
