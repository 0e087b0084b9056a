#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string_view>

#include "replica.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/names/claim.hpp"
#include "rtpm/names/storage.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "store.hpp"

namespace rtpm::names {

/// Why a change was refused, with the holder at that time.
struct SharedRefusal {
  Refusal refusal{};
  std::shared_ptr<const Record> holder{};
};

/// A change that was made, and the record that it replaced.
struct SharedGrant {
  Granted granted{};
  std::shared_ptr<const Record> former{};
};

/// Changes names in a storage that registries share: plans by the store's rules, commits, and plans
/// again if another registry changed the name first. On return the store has the change, too,
/// unless it did not arrive in time.
/// @threads  any, several at once; they wait, at most until `deadline`
class SharedWriter {
 public:
  /// `mutex` guards `store`.
  SharedWriter(rt::PiMutex& mutex, Store& store, SharedStorage& storage, Replica& replica) noexcept
      : mutex_(mutex), store_(store), storage_(storage), replica_(replica) {}

  [[nodiscard]] expected<SharedGrant, SharedRefusal> bind(const Claim& claim, bool replaces,
                                                          MonotonicTime deadline);
  [[nodiscard]] expected<void, SharedRefusal> renew(std::string_view name, Owner owner,
                                                    Duration lease, MonotonicTime deadline);
  [[nodiscard]] expected<void, SharedRefusal> unbind(std::string_view name, Owner owner,
                                                     std::uint64_t holder_revision,
                                                     MonotonicTime deadline);

 private:
  template <class Work>
  [[nodiscard]] auto locked(Work work) {
    const std::lock_guard lock(mutex_);
    return work();
  }
  [[nodiscard]] expected<std::uint64_t, StorageError> carry_out(const Plan& plan,
                                                                std::uint64_t revision,
                                                                MonotonicTime deadline);
  /// Whether to plan again.
  [[nodiscard]] bool waits_for_other(const StorageError& error, int attempt,
                                     MonotonicTime deadline);
  [[nodiscard]] unexpected<SharedRefusal> failed(const StorageError& error);
  /// Whether the refusal still holds in the storage; nullopt if the caller must plan again.
  [[nodiscard]] std::optional<SharedRefusal> confirmed(std::string_view name,
                                                       const SharedRefusal& refusal, int attempt,
                                                       MonotonicTime deadline);

  rt::PiMutex& mutex_;
  Store& store_;
  SharedStorage& storage_;
  Replica& replica_;
};

}  // namespace rtpm::names
