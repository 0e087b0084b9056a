#include "store/store.hpp"
#include "rtpm/test/text.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <set>

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

constexpr Owner kArm{.id = 1, .epoch = 10};
constexpr Owner kArmRestarted{.id = 1, .epoch = 11};
constexpr Owner kStranger{.id = 2, .epoch = 99};

constexpr MonotonicTime at(Duration time) {
  return MonotonicTime{time};
}

Claim claim(std::string_view name, Owner owner = kArm, Duration lease = 2s) {
  return {name, "rtpm://127.0.0.1:4711/object", "lab.Arm", owner, lease};
}

/// Like claim(), but allows any takeover.
Claim takeover(std::string_view name, Owner owner) {
  Claim taking = claim(name, owner);
  taking.allows_takeover = true;
  return taking;
}

/// The result of an operation, in a form that tests compare and print.
struct Ending {
  Outcome outcome = Outcome::kDone;
  int component = 0;
  friend bool operator==(const Ending&, const Ending&) = default;
  friend std::ostream& operator<<(std::ostream& out, const Ending& ending) {
    return out << outcome_text(ending.outcome, "name", 0) << " at component " << ending.component;
  }
};
template <class T>
Ending ending_of(const expected<T, Refusal>& result) {
  return result ? Ending{} : Ending{result.error().outcome, result.error().component};
}
constexpr Ending kDone{};

class StoreTest : public testing::Test {
 protected:
  void bind_all(std::initializer_list<const char*> names, Owner owner = kArm) {
    for (const char* const name : names) {
      EXPECT_EQ(ending_of(store_.bind(claim(name, owner), at(0s))), kDone) << name;
    }
  }

  Store store_;
};

/// A shared storage: its changes are made when it reports them.
class SharedStorage final : public Storage {
 public:
  [[nodiscard]] bool reports_changes() const noexcept override { return true; }
  expected<std::uint64_t, StorageError> commit(const StoredChange& change) override {
    if (change.stored != nullptr) last_ = *change.stored;
    last_.change = ++revision_;
    return revision_;
  }
  expected<void, StorageError> renew(const StoredChange&) override {
    if (while_waiting) while_waiting();
    return {};
  }
  expected<void, StorageError> confirm(std::string_view, std::uint64_t, MonotonicTime) override {
    return {};
  }
  /// The last committed change.
  [[nodiscard]] ReportedChange report() const { return {last_.name, revision_, last_}; }
  std::function<void()> while_waiting{};

 private:
  StoredName last_{};
  std::uint64_t revision_ = 0;
};

// Otherwise the registry would erase the permanent name for all when that lease ends.
TEST(SharedStore, KeepsANamePermanentThatARenewalOvertakes) {
  SharedStorage storage;
  Store store({}, 1, &storage);
  ASSERT_EQ(ending_of(store.bind(claim("lab/arm0"), at(0s))), kDone);
  store.take({storage.report()}, at(0s));
  storage.while_waiting = [&] {
    Claim permanent = claim("lab/arm0", kArm, 0s);
    permanent.is_permanent = true;
    ASSERT_EQ(ending_of(store.bind(permanent, at(1s))), kDone);
    store.take({storage.report()}, at(1s));
  };
  EXPECT_EQ(ending_of(store.renew("lab/arm0", kArm, 2s, at(1s))), kDone);
  EXPECT_TRUE(store.resolve("lab/arm0", at(1h)));
}

/// A storage that another program changes, and that reports nothing.
class ContestedStorage final : public Storage {
 public:
  expected<std::uint64_t, StorageError> commit(const StoredChange&) override {
    return unexpected{StorageError{SetupError{"it was changed"}, StorageError::Kind::kConflict}};
  }
};

TEST(ContestedStore, RefusesAChangeThatAlwaysConflicts) {
  ContestedStorage storage;
  Store store({}, 1, &storage);
  EXPECT_EQ(ending_of(store.bind(claim("lab/arm0"), at(0s))), Ending{Outcome::kStoreUnreachable});
  EXPECT_FALSE(import_names(
      storage,
      {{.name = "lab/arm0", .url = "rtpm://h:1/arm", .interface = "lab.Arm", .owner = kArm}}, {}));
}

TEST_F(StoreTest, SkipsAndReportsInvalidStoredNames) {
  const StoredName sound{
      .name = "lab/arm0", .url = "rtpm://h:1/arm", .interface = "lab.Arm", .owner = kArm};
  StoredName unsound = sound;
  unsound.name = "lab//\x1b[2J";
  testing::internal::CaptureStderr();
  store_.restore({unsound, sound}, at(0s));
  const std::string output = testing::internal::GetCapturedStderr();
  test::expect_text(output, {"are left out, such as 'lab//\\x1b[2J'"});
  EXPECT_TRUE(store_.resolve("lab/arm0", at(0s)));
}

TEST_F(StoreTest, KeepsANameAsLapsedUntilItIsBoundOrUnbound) {
  bind_all({"lab/arm0", "lab/arm1", "lab/arm2", "lab/arm3"});
  const auto revision = (*store_.resolve("lab/arm1", at(0s)))->revision;
  ASSERT_EQ(ending_of(store_.unbind("lab/arm3", kArm, at(1s))), kDone);
  EXPECT_TRUE(store_.lapsed(at(1s)).all().empty()) << "what is unbound has ended in order";
  ASSERT_EQ(store_.lapsed(at(3s)).all().size(), 3u);
  const LapsedRecord& lapsed = store_.lapsed(at(3s)).all().at("lab/arm1");
  EXPECT_EQ(lapsed.url, "rtpm://127.0.0.1:4711/object");
  EXPECT_EQ(lapsed.interface, "lab.Arm");
  EXPECT_EQ(lapsed.ended, at(2s));
  EXPECT_EQ(lapsed.revision, revision);

  ASSERT_EQ(ending_of(store_.bind(claim("lab/arm0", kStranger), at(3s))), kDone);
  EXPECT_NE(ending_of(store_.unbind("lab/arm1", kStranger, at(3s))), kDone);
  EXPECT_NE(ending_of(store_.unbind("lab/arm1", kStranger, at(3s), revision + 9)), kDone);
  EXPECT_EQ(ending_of(store_.unbind("lab/arm1", kStranger, at(3s), revision)), kDone);
  EXPECT_EQ(ending_of(store_.unbind("lab/arm2", kArmRestarted, at(3s))), kDone) << "its owner";
  EXPECT_TRUE(store_.lapsed(at(3s)).all().empty());
}

TEST(StoreLapsed, KeepsTheLatestLapsedNamesOfEachHost) {
  Store store;
  const auto lapse = [&](const std::string& name, std::uint64_t host, Duration when) {
    Claim claiming = claim(name, kArm, 1s);
    claiming.host = host;
    ASSERT_EQ(ending_of(store.bind(claiming, at(when))), kDone);
    ASSERT_TRUE(store.lapsed(at(when + 1s)).all().contains(name));
  };
  lapse("quiet", 0x0a00'0001, 0s);
  for (std::size_t i = 0; i < LapsedNames::kCountPerHostMax + 10; ++i)
    lapse("noisy/" + std::to_string(i), 0x0a00'0002, 2s * (i + 1));
  const auto& all = store.lapsed(at(10000s)).all();
  EXPECT_EQ(all.size(), LapsedNames::kCountPerHostMax + 1);
  EXPECT_TRUE(all.contains("quiet"));
  EXPECT_FALSE(all.contains("noisy/9"));
  EXPECT_TRUE(all.contains("noisy/10"));
}

TEST_F(StoreTest, RefusesMalformedClaims) {
  const auto bind = [&](auto change) {
    Claim bad = claim("lab/arm0");
    change(bad);
    return ending_of(store_.bind(bad, at(0s)));
  };
  EXPECT_EQ(bind([](auto& w) { w.name = "lab/arm 0"; }), (Ending{Outcome::kBadName, 1}));
  EXPECT_EQ(bind([](auto& w) { w.name = ""; }), (Ending{Outcome::kBadName, 0}));
  EXPECT_EQ(bind([](auto& w) { w.url = "http://h:1/p"; }), (Ending{Outcome::kBadUrl, 0}));
  EXPECT_EQ(bind([](auto& w) { w.interface = "Arm 2"; }), (Ending{Outcome::kBadInterface, 0}));
  EXPECT_EQ(bind([](auto& w) { w.owner.id = 0; }), (Ending{Outcome::kBadOwner, 0}));
  EXPECT_EQ(bind([](auto& w) { w.lease = 100ms - 1ns; }), (Ending{Outcome::kBadLease, 0}));
  EXPECT_EQ(bind([](auto& w) { w.lease = 1h + 1ns; }), (Ending{Outcome::kBadLease, 0}));
  EXPECT_EQ(bind([](auto& w) { w.lease = -1ns; }), (Ending{Outcome::kBadLease, 0}));
  EXPECT_EQ(store_.size(), 0U);
  EXPECT_EQ(bind([](auto& w) { w.lease = 1h; }), kDone);
  EXPECT_EQ(ending_of(store_.renew("lab/arm0", kArm, Duration::max(), at(0s))),
            (Ending{Outcome::kBadLease, 0}));
  EXPECT_EQ(ending_of(store_.renew("lab//", kArm, 1s, at(0s))), (Ending{Outcome::kBadName, 1}));
  EXPECT_EQ(ending_of(store_.resolve("lab/\xff", at(0s))), (Ending{Outcome::kBadName, 1}));
  EXPECT_EQ(ending_of(store_.unbind("/", kArm, at(0s))), (Ending{Outcome::kBadName, 0}));
  EXPECT_EQ(ending_of(store_.list("lab/", "", 9, at(0s))), (Ending{Outcome::kBadName, 1}));
  EXPECT_EQ(ending_of(store_.list("lab", "a b", 9, at(0s))), (Ending{Outcome::kBadName, 0}));
}

TEST(StoreLimits, RefusesMoreNamesThanItMayHold) {
  Store store({.name_count_max = 3, .name_count_per_owner_max = 2});
  ASSERT_TRUE(store.bind(claim("a"), at(0s)));
  ASSERT_TRUE(store.bind(claim("b"), at(0s)));
  EXPECT_EQ(ending_of(store.bind(claim("c"), at(0s))), (Ending{Outcome::kOwnerFull, 0}));
  ASSERT_TRUE(store.bind(claim("c", kStranger), at(0s)));
  EXPECT_EQ(ending_of(store.bind(claim("d", {3, 1}), at(0s))), (Ending{Outcome::kFull, 0}));
  // A full store still allows renewing, rebinding and taking over its names.
  EXPECT_EQ(ending_of(store.bind(claim("a"), at(0s))), kDone);
  EXPECT_EQ(ending_of(store.rebind(takeover("a", kStranger), at(0s))), kDone);
  EXPECT_EQ(ending_of(store.rebind(takeover("b", kStranger), at(0s))),
            (Ending{Outcome::kOwnerFull, 0}));
  // A removed name frees its capacity, for the registry and for its owner.
  ASSERT_TRUE(store.unbind("c", kStranger, at(0s)));
  EXPECT_EQ(ending_of(store.bind(claim("d", {3, 1}, 10s), at(0s))), kDone);
  EXPECT_EQ(ending_of(store.bind(claim("e", kArm), at(2s))), kDone);
  EXPECT_EQ(store.size(), 2U);
}

constexpr std::uint32_t kOwnHost = 0x7f00'0001;
constexpr std::uint32_t kNearHost = 0x0a00'0001;
constexpr std::uint32_t kFarHost = 0x0a00'0002;

Claim claim_from(std::uint64_t host, std::string_view name, Owner owner = kArm) {
  Claim from = claim(name, owner);
  from.host = host;
  return from;
}

TEST(StoreRevision, StaysWithItsHolder) {
  Store store;
  const auto first = store.bind(claim("lab/arm0"), at(0s));
  ASSERT_TRUE(store.renew("lab/arm0", kArm, 2s, at(1s)));
  EXPECT_EQ(store.bind(claim("lab/arm0"), at(1s))->revision, first->revision);
  const auto later = store.bind(claim("lab/arm0", kArmRestarted), at(1s));
  EXPECT_NE(later->revision, first->revision) << "another start is another holder";
  ASSERT_TRUE(store.unbind("lab/arm0", kArmRestarted, at(1s)));
  EXPECT_NE(store.bind(claim("lab/arm0", kArmRestarted), at(1s))->revision, later->revision);
}

// Any program could claim to be a later start, so one from another host has to wait.
TEST(StoreRestart, RebindsAtOnceFromItsHostElseAfterTheLease) {
  Store store;
  ASSERT_TRUE(store.bind(claim_from(kNearHost, "lab/arm0"), at(0s)));
  EXPECT_EQ(ending_of(store.bind(claim_from(kFarHost, "lab/arm0", kArmRestarted), at(1s))),
            (Ending{Outcome::kAlreadyBound, 1}));
  EXPECT_EQ(ending_of(store.bind(claim_from(kNearHost, "lab/arm0", kArmRestarted), at(1s))), kDone);
  EXPECT_EQ(ending_of(store.bind(claim_from(kFarHost, "lab/arm0", kArmRestarted), at(1s))), kDone)
      << "the same start may come by another way";
  constexpr Owner kLater{.id = kArm.id, .epoch = 12};
  EXPECT_EQ(ending_of(store.bind(claim_from(kNearHost, "lab/arm0", kLater), at(3s))), kDone)
      << "its lease has ended";
}

TEST(StoreFirstLease, IsShortUntilTheNameHasBeenHeldThatLong) {
  Store store;  // The default first lease is 10 s.
  const auto granted = store.bind(claim("lab/arm0", kArm, 1h), at(0s));
  ASSERT_TRUE(granted);
  EXPECT_EQ(granted->lease, 10s);
  EXPECT_EQ(store.bind(claim("lab/short", kArm, 2s), at(0s))->lease, 2s);
  ASSERT_TRUE(store.bind(claim("lab/dead", kStranger, 1h), at(0s)));
  ASSERT_TRUE(store.renew("lab/arm0", kArm, 1h, at(1s)));
  EXPECT_EQ(store.resolve("lab/arm0", at(1s)).value()->expires, at(11s))
      << "a renewal at once gets no more";
  EXPECT_FALSE(store.resolve("lab/dead", at(10s)));
  ASSERT_TRUE(store.renew("lab/arm0", kArm, 1h, at(10s)));
  EXPECT_EQ(store.resolve("lab/arm0", at(10s)).value()->expires, at(1h + 10s));
  EXPECT_EQ(store.bind(claim("lab/arm0", kArm, 1h), at(11s))->lease, 1h) << "it holds it still";
  EXPECT_EQ(store.bind(claim("lab/arm0", kArmRestarted, 1h), at(11s))->lease, 10s);
}

// One host invents owners with a name each; then owners with many names.
TEST(StoreHosts, HaveAShareOfTheNamesAndOwnersEach) {
  Store store;
  const Limits limits;
  const auto fill = [&](std::uint64_t host, std::uint64_t first_owner, std::size_t names_of_each) {
    std::size_t count = 0;
    while (true) {
      const Owner owner{.id = first_owner + count / names_of_each, .epoch = 1};
      const std::string name = "n" + std::to_string(host) + "/" + std::to_string(count);
      const auto bound = store.bind(claim_from(host, name, owner), at(0s));
      if (!bound) return std::pair{count, bound.error().outcome};
      ++count;
    }
  };
  EXPECT_EQ(fill(kNearHost, 1'000, 1),
            std::pair(limits.owner_count_per_host_max, Outcome::kHostOwnersFull));
  EXPECT_EQ(fill(kFarHost, 2'000, 16),
            std::pair(limits.name_count_per_host_max, Outcome::kHostFull));
  EXPECT_EQ(fill(kOwnHost, 3'000, 16),
            std::pair(limits.name_count_own_host_max, Outcome::kHostFull));
  EXPECT_EQ(ending_of(store.bind(claim_from(kOwnHost + 1, "more"), at(0s))),
            (Ending{Outcome::kHostFull, 0}))
      << "its addresses are one host";
  const auto uses = store.usage().hosts(2);
  ASSERT_EQ(uses.size(), 2u);
  EXPECT_EQ(uses[0].host, kOwnHost);
  EXPECT_EQ(uses[0].name_count, limits.name_count_own_host_max);
  EXPECT_EQ(uses[1].host, kFarHost);
  EXPECT_EQ(uses[1].owner_count, 32u);
  // Other hosts find free slots, and full ones renew their names.
  EXPECT_TRUE(store.bind(claim_from(0x0a00'0003, "lab/arm0", kArm), at(1s)));
  EXPECT_TRUE(store.renew("n167772161/0", {1'000, 1}, 2s, at(1s)));
  EXPECT_TRUE(store.bind(claim_from(kNearHost, "n167772161/0", {1'000, 2}), at(1s)));
  // Expired names no longer count.
  EXPECT_TRUE(store.bind(claim_from(kFarHost, "again"), at(2s)));
  EXPECT_EQ(store.usage().hosts(9).size(), 3u);
}

TEST(StoreList, ListsPageByPageWhileNamesComeAndGo) {
  Store store({.name_count_per_owner_max = 1000});
  const auto name_of = [](int i) { return "lab/" + std::to_string(100 + i) + "/arm"; };
  std::set<std::string> staying;
  for (int i = 0; i < 500; ++i) {
    ASSERT_TRUE(store.bind(claim(name_of(i)), at(0s)));
    if (i % 7 != 0) staying.insert(name_of(i));
  }
  std::set<std::string> seen;
  std::string after;
  int page_count = 0;
  for (bool is_last = false; !is_last; ++page_count) {
    const auto page = store.list("lab", after, 13, at(0s));
    ASSERT_TRUE(page);
    ASSERT_LE(page->records.size(), 13U);
    for (const Record* record : page->records) {
      EXPECT_GT(record->name, after);
      EXPECT_TRUE(seen.insert(record->name).second) << record->name;
    }
    is_last = page->is_last;
    after = *seen.rbegin();
    // Some unseen names go, and some come; the name that was seen last goes, too.
    for (int i = 0; i < 500; i += 7) {
      static_cast<void>(store.unbind(name_of(i), kArm, at(0s)));
    }
    ASSERT_TRUE(store.bind(claim("lab/" + std::to_string(page_count) + "-new"), at(0s)));
  }
  EXPECT_GE(page_count, static_cast<int>(staying.size()) / 13);
  for (const std::string& name : staying)
    EXPECT_TRUE(seen.contains(name)) << name;
}

TEST(OutcomeText, NamesTheComponentAndTheRemedy) {
  test::expect_text(outcome_text(Outcome::kNotFound, "lab/arm0/tip", 1),
                    {"nothing is at 'lab/arm0'"});
  test::expect_text(outcome_text(Outcome::kBadName, "lab/arm 0", 1),
                    {"component 2 of the name 'lab/arm 0', 'arm 0'"});
  test::expect_text(outcome_text(Outcome::kBadName, "1/2/3/4/5/6/7/8/9", 8),
                    {"more than 8 components"});
  test::expect_text(outcome_text(Outcome::kBadName, "", 0), {"empty"});
  test::expect_text(outcome_text(Outcome::kNotADirectory, "lab/arm0/tip", 1),
                    {"'lab/arm0' is itself"});
  // Texts of other programs are escaped before they reach the terminal.
  EXPECT_EQ(outcome_text(Outcome::kNotFound, "\x1b[2J\n", 0).find('\x1b'), std::string::npos);
  test::expect_text(outcome_text(static_cast<Outcome>(200), "a", 0), {"unknown outcome 200"});
}

}  // namespace
}  // namespace rtpm::names
