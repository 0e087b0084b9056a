#include "rtpm/names/storage.hpp"

#include <limits>
#include <utility>

#include "rtpm/names/outcome.hpp"
#include "rtpm/rt/host.hpp"
#include "store/store.hpp"

namespace rtpm::names {
namespace {

/// Names count as out of date when a storage has not confirmed them for this long.
constexpr Duration kStaleAfter = std::chrono::seconds{2};

/// Waits for the disk only at the last change, which also flushes the earlier ones.
class DurableAtTheEnd final : public Storage {
 public:
  explicit DurableAtTheEnd(Storage& storage) noexcept : storage_(storage) {}
  expected<StoredContent, SetupError> load() override { return storage_.load(); }
  expected<std::uint64_t, StorageError> commit(const StoredChange& change) override {
    StoredChange passed = change;
    passed.is_durable = is_last;
    return storage_.commit(passed);
  }
  bool is_last = false;

 private:
  Storage& storage_;
};

}  // namespace

expected<StoredContent, SetupError> Storage::load() {
  // Random, so that revisions differ between starts.
  return StoredContent{.first_revision = rt::random_u64() >> 1 | 1};
}

expected<void, SetupError> Storage::follow(Follower&) {
  return {};
}

expected<std::uint64_t, StorageError> Storage::commit(const StoredChange& change) {
  return change.revision;
}

expected<void, StorageError> Storage::renew(const StoredChange&) {
  return {};
}

expected<void, StorageError> Storage::confirm(std::string_view, std::uint64_t, MonotonicTime) {
  return {};
}

Duration Storage::stale_for(MonotonicTime now) const noexcept {
  const Duration unconfirmed = now - current_as_of();
  return unconfirmed < kStaleAfter ? Duration{0} : unconfirmed;
}

expected<std::size_t, SetupError> import_names(Storage& storage,
                                               const std::vector<StoredName>& names,
                                               const Limits& limits) {
  auto content = storage.load();
  if (!content) return unexpected{std::move(content.error())};
  if (!content->faults.empty()) return setup_error(content->faults.front());
  DurableAtTheEnd durable(storage);
  // The limits per server and host apply to callers, not to the operator.
  Limits own = limits;
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  own.name_count_per_owner_max = kNone;
  own.name_count_per_host_max = kNone;
  own.owner_count_per_host_max = kNone;
  own.property_byte_per_owner_max = kNone;
  Store store(own, content->first_revision, &durable);
  store.restore(std::move(content->names), MonotonicTime{});
  std::size_t count = 0;
  for (const StoredName& name : names) {
    Claim claim{name.name, name.url, name.interface, name.owner};
    claim.properties = name.properties;
    claim.is_permanent = true;
    claim.allows_takeover = true;
    durable.is_last = count + 1 == names.size();
    const auto bound = store.rebind(claim, MonotonicTime{});
    if (!bound) {
      const Refusal& refusal = bound.error();
      return setup_error("after " + std::to_string(count) + " names, " +
                             outcome_text(refusal.outcome, name.name, refusal.component),
                         store.storage_trouble());
    }
    ++count;
  }
  return count;
}

}  // namespace rtpm::names
