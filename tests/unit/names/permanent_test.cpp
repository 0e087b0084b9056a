#include <gtest/gtest.h>

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "registry_fixture.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/policy.hpp"
#include "store/store.hpp"

// Permanent names, storages, and permissions.
namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

constexpr Owner kOwner{.id = 1, .epoch = 1};
constexpr Owner kOther{.id = 2, .epoch = 1};
constexpr const char* kUrl = "rtpm://10.0.0.1:1/p";

constexpr MonotonicTime at(Duration time) {
  return MonotonicTime{time};
}

Claim permanent(std::string_view name, Owner owner = kOwner) {
  Claim claim{name, kUrl, "lab.Arm", owner, {}};
  claim.is_permanent = true;
  return claim;
}
Claim leased(std::string_view name, Owner owner = kOwner) {
  return {name, kUrl, "lab.Arm", owner, 2s};
}

/// A storage in memory that counts, and fails on demand.
class CountingStorage final : public Storage {
 public:
  expected<StoredContent, SetupError> load() override {
    StoredContent content{.first_revision = 100};
    for (const auto& [name, stored] : names)
      content.names.push_back(stored);
    for (const auto& [name, lapse] : lapsed)
      content.lapsed.push_back(lapse);
    return content;
  }
  expected<std::uint64_t, StorageError> commit(const StoredChange& change) override {
    if (failure) return unexpected{StorageError{{"the disk has a fault"}, *failure}};
    ++(change.is_durable ? durable_count : other_count);
    const std::string name(change.name);
    if (change.lapsed) {
      lapsed.insert_or_assign(name, StoredLapse{names.at(name), *change.lapsed});
    } else {
      lapsed.erase(name);
    }
    if (change.stored != nullptr) {
      names.insert_or_assign(name, *change.stored);
    } else {
      names.erase(name);
    }
    return change.revision;
  }
  std::map<std::string, StoredName> names{};
  std::map<std::string, StoredLapse> lapsed{};
  std::optional<StorageError::Kind> failure{};
  int durable_count = 0;
  int other_count = 0;
};

Outcome outcome_of(const auto& result) {
  if (result) return Outcome::kDone;
  return std::optional<Outcome>(result.error().outcome).value_or(Outcome::kDone);
}

TEST(Permanent, NameNeedsNoLease) {
  Store store;
  const auto bound = store.bind(permanent("lab/arm0"), at(0s));
  ASSERT_TRUE(bound);
  EXPECT_EQ(bound->lease, Duration::max());
  EXPECT_TRUE(store.resolve("lab/arm0", at(24h * 3650)));
  EXPECT_TRUE(store.renew("lab/arm0", kOwner, 2s, at(24h)));
  EXPECT_TRUE(store.resolve("lab/arm0", at(24h * 3650)));
  EXPECT_EQ(outcome_of(store.bind(leased("lab/arm0", kOther), at(1s))), Outcome::kAlreadyBound);
  // Its owner may give the name a lease.
  ASSERT_TRUE(store.bind(leased("lab/arm0"), at(24h * 3650)));
  EXPECT_FALSE(store.resolve("lab/arm0", at(24h * 3651)));
}

TEST(StoredNames, AreStoredBeforeAChangeTakesEffect) {
  CountingStorage storage;
  Store store({}, 1, &storage);
  ASSERT_TRUE(store.bind(permanent("lab/arm0"), at(0s)));
  ASSERT_TRUE(store.bind(permanent("lab/arm0"), at(0s)));  // This changes nothing.
  EXPECT_EQ(storage.durable_count, 1);
  ASSERT_TRUE(store.bind(leased("lab/arm1"), at(0s)));
  ASSERT_TRUE(store.renew("lab/arm1", kOwner, 2s, at(1s)));
  EXPECT_EQ(storage.other_count, 1) << "a renewal is not stored";
  EXPECT_EQ(storage.names.size(), 2u);
  store.expire(at(10s));
  EXPECT_EQ(storage.names.size(), 1u);
  ASSERT_TRUE(store.unbind("lab/arm0", kOwner, at(10s)));
  EXPECT_EQ(storage.durable_count, 2);
  EXPECT_TRUE(storage.names.empty());
}

TEST(StoredNames, AreUnchangedIfTheStorageFails) {
  CountingStorage storage;
  Store store({}, 1, &storage);
  ASSERT_TRUE(store.bind(permanent("lab/arm0"), at(0s)));
  const std::uint64_t revision = store.log().revision();
  for (const auto& [kind, outcome] :
       {std::pair{StorageError::Kind::kFull, Outcome::kStorageFull},
        std::pair{StorageError::Kind::kReadOnly, Outcome::kReadOnly},
        std::pair{StorageError::Kind::kFailed, Outcome::kNotStored}}) {
    storage.failure = kind;
    EXPECT_EQ(outcome_of(store.bind(permanent("lab/arm1"), at(0s))), outcome);
    EXPECT_EQ(outcome_of(store.unbind("lab/arm0", kOwner, at(0s))), outcome);
    EXPECT_EQ(store.storage_trouble(), "the disk has a fault.");
  }
  EXPECT_TRUE(store.resolve("lab/arm0", at(0s)));
  EXPECT_FALSE(store.resolve("lab/arm1", at(0s)));
  EXPECT_EQ(store.log().revision(), revision) << "nothing has changed";
}

TEST(StoredNames, AreRestoredWithANewLease) {
  CountingStorage storage;
  {
    Store store({}, 1, &storage);
    ASSERT_TRUE(store.bind(permanent("lab/arm0"), at(0s)));
    ASSERT_TRUE(store.bind(leased("lab/arm1"), at(0s)));
  }
  auto content = storage.load();
  Store store({}, content->first_revision, &storage);
  store.restore(std::move(content->names), at(60s));
  EXPECT_TRUE(store.renew("lab/arm1", kOwner, 2s, at(61s)));
  EXPECT_EQ(outcome_of(store.bind(leased("lab/arm1", kOther), at(62s))), Outcome::kAlreadyBound);
  EXPECT_FALSE(store.resolve("lab/arm1", at(63s)));
  EXPECT_TRUE(store.resolve("lab/arm0", at(63s)));
  EXPECT_GT(store.bind(permanent("lab/arm2"), at(63s))->revision, 100u);
}

TEST(StoredNames, IncludeLapsedNamesUntilTheyAreBoundOrDismissed) {
  CountingStorage storage;
  {
    Store store({}, 1, &storage);
    ASSERT_TRUE(store.bind(leased("lab/arm0"), at(0s)));
    ASSERT_TRUE(store.bind(leased("lab/arm1"), at(0s)));
    store.expire(at(10s));
    EXPECT_EQ(storage.lapsed.size(), 2u);
    EXPECT_EQ(storage.lapsed.at("lab/arm1").ended, at(2s));
  }
  auto content = storage.load();
  Store store({}, content->first_revision, &storage);
  store.restore(std::move(content->names), at(60s));
  store.restore_lapsed(std::move(content->lapsed));
  EXPECT_EQ(store.lapsed(at(60s)).all().size(), 2u);
  EXPECT_EQ(store.lapsed(at(60s)).all().at("lab/arm1").ended, at(2s));
  ASSERT_TRUE(store.bind(leased("lab/arm0"), at(60s)));
  EXPECT_EQ(storage.lapsed.size(), 1u);
  storage.failure = StorageError::Kind::kReadOnly;
  EXPECT_EQ(outcome_of(store.unbind("lab/arm1", kOwner, at(60s))), Outcome::kReadOnly);
  EXPECT_EQ(store.lapsed(at(60s)).all().size(), 1u);
  storage.failure.reset();
  EXPECT_EQ(outcome_of(store.unbind("lab/arm1", kOwner, at(60s))), Outcome::kDone);
  EXPECT_TRUE(storage.lapsed.empty());
  EXPECT_TRUE(store.lapsed(at(60s)).all().empty());
}

TEST(StoredNames, IncludeNoMoreLapsedNamesThanTheRegistry) {
  CountingStorage storage;
  Store store({}, 1, &storage);
  for (std::size_t i = 0; i < LapsedNames::kCountPerHostMax + 10; ++i) {
    ASSERT_TRUE(store.bind(leased("noisy/" + std::to_string(i)), at(3s * i)));
    store.expire(at(3s * i + 2s));
  }
  EXPECT_EQ(storage.lapsed.size(), LapsedNames::kCountPerHostMax);
  EXPECT_FALSE(storage.lapsed.contains("noisy/9"));
  EXPECT_TRUE(storage.lapsed.contains("noisy/10"));
}

// ---- changes from a shared storage --------------------------------------------------------

ReportedChange reported(std::string name, std::uint64_t revision, std::uint64_t holder = 0) {
  StoredName stored{.name = name,
                    .url = kUrl,
                    .interface = "lab.Arm",
                    .owner = kOwner,
                    .revision = holder == 0 ? revision : holder,
                    .change = revision};
  return {std::move(name), revision, std::move(stored)};
}

TEST(ReportedChanges, KeepTheRevisionsOfTheStorage) {
  Store store({}, 10);
  store.take({reported("lab/arm0", 12), reported("lab/arm1", 15)}, at(0s));
  store.take({reported("lab/arm0", 16, 12)}, at(0s));  // Only its lease differs.
  EXPECT_EQ((*store.resolve("lab/arm0", at(0s)))->revision, 12u);
  EXPECT_EQ(store.log().revision(), 15u) << "nothing that a watcher sees";
  store.take({{"lab/arm0", 17, std::nullopt}, {"lab/never", 18, std::nullopt}}, at(0s));
  EXPECT_FALSE(store.resolve("lab/arm0", at(0s)));
  EXPECT_EQ(store.log().count_after(9), 3u);
  EXPECT_EQ(store.log().restart_count(), 0u);
  EXPECT_EQ(store.next_revision(), 19u);
}

TEST(ReportedChanges, TurnExpiredNamesIntoLapsedOnes) {
  Store store({}, 10);
  const auto leased_one = [](const char* name, std::uint64_t revision) {
    ReportedChange change = reported(name, revision);
    change.stored->lease = 2s;
    change.stored->stay = 3s;
    return change;
  };
  store.take({leased_one("lab/lost", 12), leased_one("lab/ended", 13), reported("lab/kept", 14)},
             at(0s));
  store.take({{"lab/lost", 15, std::nullopt, true},
              {"lab/ended", 16, std::nullopt, false},
              {"lab/kept", 17, std::nullopt, true}},
             at(5s));
  ASSERT_EQ(store.lapsed(at(5s)).all().size(), 1u);
  EXPECT_EQ(store.lapsed(at(5s)).all().at("lab/lost").ended, at(5s));
  store.take({leased_one("lab/lost", 18)}, at(6s));
  EXPECT_TRUE(store.lapsed(at(6s)).all().empty());
}

TEST(ReportedChanges, RestartTheHistoryIfTheyShareARevision) {
  Store store({}, 10);
  store.take({reported("lab/arm0", 12), reported("lab/arm1", 13)}, at(0s));
  store.take({{"lab/arm0", 14, std::nullopt}, {"lab/arm1", 14, std::nullopt}}, at(0s));
  EXPECT_EQ(store.size(), 0u);
  EXPECT_EQ(store.log().restart_count(), 1u);
  EXPECT_FALSE(store.log().reaches(13)) << "watchers get the state";
  EXPECT_TRUE(store.log().reaches(14));
}

TEST(ReportedChanges, SkipInvalidNames) {
  Store store({}, 10);
  ReportedChange bad_url = reported("lab/arm1", 13);
  bad_url.stored->url = "elsewhere";
  store.take({reported("lab//arm0", 12), bad_url, reported("lab/arm2", 14)}, at(0s));
  EXPECT_EQ(store.size(), 1u);
  store.take({[&] {
               auto changed = reported("lab/arm2", 15);
               changed.stored->interface = "no interface";
               return changed;
             }()},
             at(0s));
  EXPECT_EQ(store.size(), 0u);
}

// ---- permissions ---------------------------------------------------------------------------

/// Lets owner 1 change names, and all callers of this host read.
class OneOwner final : public Policy {
 public:
  bool allows(const Caller& caller, Operation operation, std::string_view name) const override {
    if (name == "secret") return false;
    const bool is_change = operation == Operation::kBind || operation == Operation::kUnbind ||
                           operation == Operation::kRenew;
    return caller.host.is_this_host() && caller.session != 0 &&
           (!is_change || caller.owner.id == kOwner.id);
  }
};

TEST(Policies, CheckEveryOperation) {
  auto registry = make_registry({.policy = std::make_unique<const OneOwner>()});
  ASSERT_TRUE(registry);
  ServedRegistry served(**registry);
  rpc::Node node{{.wait = {.strategy = rt::WaitStrategy::kBlock}, .collocates = false}};
  Directory directory(node, served.url());
  ASSERT_TRUE(directory.bind(leased("lab/arm0")));
  EXPECT_EQ(outcome_of(directory.bind(leased("lab/arm1", kOther))), Outcome::kDenied);
  EXPECT_EQ(outcome_of(directory.renew("lab/arm0", kOther, 2s)), Outcome::kDenied);
  EXPECT_EQ(outcome_of(directory.unbind("lab/arm0", kOther)), Outcome::kDenied);
  EXPECT_EQ(outcome_of(directory.resolve("secret")), Outcome::kDenied);
  EXPECT_EQ(outcome_of(directory.list("secret")), Outcome::kDenied);
  EXPECT_TRUE(directory.renew("lab/arm0", kOwner, 2s));
  EXPECT_TRUE(directory.resolve("lab/arm0"));
  EXPECT_TRUE(directory.find({}));
  EXPECT_TRUE(directory.unbind("lab/arm0", kOwner));
}

}  // namespace
}  // namespace rtpm::names
