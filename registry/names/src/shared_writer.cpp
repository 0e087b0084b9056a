#include "shared_writer.hpp"

#include <algorithm>
#include <mutex>
#include <string>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

// How long a change that is stored waits to be seen here, too.
constexpr Duration kSeenWaitMax = 300ms;
// Before a name is looked at again whose lease has ended and whose end is not yet told.
constexpr Duration kAgainPause = 20ms;
// Attempts without that pause.
constexpr int kQuickAttempts = 3;

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

bool SharedWriter::waits_for_other(const StorageError& error, int attempt,
                                   MonotonicTime deadline) {
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

expected<SharedGrant, SharedRefusal> SharedWriter::bind(const Claim& claim, bool replaces,
                                                        MonotonicTime deadline) {
  for (int attempt = 0;; ++attempt) {
    Plan plan;
    std::uint64_t revision = 0;
    {
      const std::lock_guard lock(mutex_);
      auto planned = store_.plan(claim, replaces, rt::now());
      if (!planned) return unexpected{kept(planned.error())};
      plan = std::move(*planned);
      revision = store_.next_revision();
    }
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
    Plan plan;
    std::uint64_t revision = 0;
    {
      const std::lock_guard lock(mutex_);
      auto planned = store_.plan_renewal(name, owner, lease, rt::now());
      if (!planned) return unexpected{kept(planned.error())};
      plan = std::move(*planned);
      revision = store_.next_revision();
    }
    if (plan.next.is_permanent()) return {};
    const auto done = carry_out(plan, revision, deadline);
    if (done) return {};
    if (!waits_for_other(done.error(), attempt, deadline)) return failed(done.error());
  }
}

expected<void, SharedRefusal> SharedWriter::unbind(std::string_view name, Owner owner,
                                                   std::uint64_t holder_revision,
                                                   MonotonicTime deadline) {
  for (int attempt = 0;; ++attempt) {
    StoredChange change{.name = name, .deadline = deadline};
    {
      const std::lock_guard lock(mutex_);
      const auto found = store_.plan_unbind(name, owner, rt::now(), holder_revision);
      if (!found) return unexpected{kept(found.error())};
      change.revision = store_.next_revision();
      change.is_durable = (*found)->is_permanent();
      change.expected = (*found)->change;
    }
    const auto done = storage_.commit(change);
    if (done) {
      static_cast<void>(replica_.wait_for(*done, std::min(deadline, rt::now() + kSeenWaitMax)));
      return {};
    }
    if (!waits_for_other(done.error(), attempt, deadline)) return failed(done.error());
  }
}

}  // namespace rtpm::names
