#include "shared_writer.hpp"

#include <algorithm>
#include <mutex>
#include <string>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

// How long to wait until a change that is stored has arrived in the store, too.
constexpr Duration kSeenWaitMax = 300ms;
// Pause before checking again a name whose lease has ended while its end is not reported yet.
constexpr Duration kAgainPause = 20ms;
// The number of attempts without that pause.
constexpr int kQuickAttempts = 3;

/// Whether the refusal says who holds the name, or that nobody holds it.
bool is_of_holder(Outcome outcome) noexcept {
  return outcome == Outcome::kNotFound || outcome == Outcome::kAlreadyBound ||
         outcome == Outcome::kStaleEpoch || outcome == Outcome::kNotOwner ||
         outcome == Outcome::kStaleRevision;
}

SharedRefusal kept(const Refusal& refusal) {
  SharedRefusal made{refusal};
  if (refusal.holder != nullptr) made.holder = std::make_shared<const Record>(*refusal.holder);
  made.refusal.holder = made.holder.get();
  return made;
}

}  // namespace

expected<std::uint64_t, StorageError> SharedWriter::carry_out(const Plan& plan,
                                                              std::uint64_t revision,
                                                              MonotonicTime deadline) {
  const bool is_other_lease = plan.former && plan.former->lease != plan.next.lease;
  if (plan.is_renewal && !is_other_lease) {
    auto renewed = storage_.renew(plan.next.name, plan.former->change, deadline);
    if (!renewed) return unexpected{std::move(renewed.error())};
    const std::lock_guard lock(mutex_);
    store_.note_renewal(plan.next.name, rt::now());
    return plan.next.change;
  }
  const StoredName stored = stored_name_of(plan.next);
  return storage_.commit({plan.next.name, &stored, revision, plan.is_durable,
                          plan.former ? plan.former->change : 0, deadline});
}

bool SharedWriter::waits_for_other(const StorageError& error, int attempt, MonotonicTime deadline) {
  if (error.kind != StorageError::Kind::kConflict) return false;
  const bool is_told = error.revision != 0;
  if (is_told && !replica_.wait_for(error.revision, deadline)) return false;
  if (is_told && attempt < kQuickAttempts) return true;
  if (rt::now() + kAgainPause >= deadline) return false;
  rt::sleep_until(rt::now() + kAgainPause);
  return true;
}

unexpected<SharedRefusal> SharedWriter::failed(const StorageError& error) {
  const std::lock_guard lock(mutex_);
  return unexpected{SharedRefusal{store_.refusal_of(error)}};
}

// A registry may lag behind: a change that it refuses because of a name may be valid at another.
std::optional<SharedRefusal> SharedWriter::confirmed(std::string_view name,
                                                     const SharedRefusal& refusal, int attempt,
                                                     MonotonicTime deadline) {
  if (!is_of_holder(refusal.refusal.outcome)) return refusal;
  const std::uint64_t change = refusal.holder ? refusal.holder->change : 0;
  const auto same = storage_.confirm(name, change, deadline);
  if (same) return refusal;
  if (waits_for_other(same.error(), attempt, deadline)) return std::nullopt;
  return failed(same.error()).error;
}

expected<SharedGrant, SharedRefusal> SharedWriter::bind(const Claim& claim, bool replaces,
                                                        MonotonicTime deadline) {
  for (int attempt = 0;; ++attempt) {
    std::uint64_t revision = 0;
    auto planned = locked([&]() -> expected<Plan, SharedRefusal> {
      revision = store_.next_revision();
      auto made = store_.plan(claim, replaces, rt::now());
      if (!made) return unexpected{kept(made.error())};
      return std::move(*made);
    });
    if (!planned) {
      auto refused = confirmed(claim.name, planned.error(), attempt, deadline);
      if (refused) return unexpected{std::move(*refused)};
      continue;
    }
    Plan& plan = *planned;
    const auto done = carry_out(plan, revision, deadline);
    if (done) {
      static_cast<void>(replica_.wait_for(*done, std::min(deadline, rt::now() + kSeenWaitMax)));
      if (!plan.keeps_holder()) plan.next.revision = *done;
      return SharedGrant{plan.granted(), std::move(plan.former)};
    }
    if (!waits_for_other(done.error(), attempt, deadline)) return failed(done.error());
  }
}

expected<void, SharedRefusal> SharedWriter::renew(std::string_view name, Owner owner,
                                                  Duration lease, MonotonicTime deadline) {
  for (int attempt = 0;; ++attempt) {
    std::uint64_t revision = 0;
    const auto planned = locked([&]() -> expected<Plan, SharedRefusal> {
      revision = store_.next_revision();
      auto made = store_.plan_renewal(name, owner, lease, rt::now());
      if (!made) return unexpected{kept(made.error())};
      return std::move(*made);
    });
    if (!planned) {
      auto refused = confirmed(name, planned.error(), attempt, deadline);
      if (refused) return unexpected{std::move(*refused)};
      continue;
    }
    const auto done = carry_out(*planned, revision, deadline);
    if (done) return {};
    if (!waits_for_other(done.error(), attempt, deadline)) return failed(done.error());
  }
}

expected<void, SharedRefusal> SharedWriter::unbind(std::string_view name, Owner owner,
                                                   std::uint64_t holder_revision,
                                                   MonotonicTime deadline) {
  for (int attempt = 0;; ++attempt) {
    const auto planned = locked([&]() -> expected<StoredChange, SharedRefusal> {
      const auto found = store_.plan_unbind(name, owner, rt::now(), holder_revision);
      if (!found) return unexpected{kept(found.error())};
      return StoredChange{
          name,    nullptr, store_.next_revision(), (*found)->is_permanent(), (*found)->change,
          deadline};
    });
    if (!planned) {
      auto refused = confirmed(name, planned.error(), attempt, deadline);
      if (!refused) continue;
      const auto dismissed = locked([&] { return store_.dismiss(name, owner, holder_revision); });
      if (dismissed && *dismissed) return {};
      return unexpected{std::move(*refused)};
    }
    const auto done = storage_.commit(*planned);
    if (done) {
      static_cast<void>(replica_.wait_for(*done, std::min(deadline, rt::now() + kSeenWaitMax)));
      return {};
    }
    if (!waits_for_other(done.error(), attempt, deadline)) return failed(done.error());
  }
}

}  // namespace rtpm::names
