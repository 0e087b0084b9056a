#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "etcd_node.hpp"
#include "rtpm/etcd_store/etcd_storage.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"

// The promises of a shared storage to the registries that use it.
namespace rtpm::storage_test {
namespace {

using namespace std::chrono_literals;
using names::ReportedChange;
using names::Storage;
using names::StoredName;
using Kind = names::StorageError::Kind;

/// Records its notifications.
class Followed final : public Storage::Follower {
 public:
  void on_changes(std::vector<ReportedChange> changes) override {
    const std::lock_guard lock(mutex_);
    for (ReportedChange& change : changes)
      changes_.push_back(std::move(change));
    told_.notify_all();
  }
  void on_restart(std::vector<StoredName> names, std::uint64_t revision,
                  bool is_replaced) override {
    const std::lock_guard lock(mutex_);
    restart_ = {std::move(names), revision, is_replaced};
    told_.notify_all();
  }
  void lock() override {}
  void unlock() override {}
  void on_trouble(const std::string&) override {}

  [[nodiscard]] std::vector<ReportedChange> wait_for(std::size_t count) {
    std::unique_lock lock(mutex_);
    told_.wait_for(lock, 10s, [&] { return changes_.size() >= count; });
    return changes_;
  }
  /// The contents that it was given at each new start.
  struct Restart {
    std::vector<StoredName> names{};
    std::uint64_t revision = 0;
    bool is_replaced = false;
  };
  [[nodiscard]] std::optional<Restart> wait_for_restart() {
    std::unique_lock lock(mutex_);
    told_.wait_for(lock, 20s, [&] { return restart_.has_value(); });
    return std::exchange(restart_, std::nullopt);
  }

 private:
  std::mutex mutex_;
  std::condition_variable told_{};
  std::vector<ReportedChange> changes_{};
  std::optional<Restart> restart_{};
};

bool becomes_current(const Storage& storage) {
  return test::await([&, now = rt::now()] { return storage.current_as_of() >= now; });
}

StoredName named(std::string name, std::uint64_t revision, Duration lease = {}) {
  return {.name = std::move(name),
          .url = "rtpm://10.0.0.1:1/p",
          .interface = "lab.Arm",
          .owner = {7, 1},
          .revision = revision,
          .change = revision,
          .host = 0x7f00'0001,
          .lease = lease};
}

class Shared : public testing::Test {
 protected:
  void SetUp() override {
    if (EtcdNode::shared() == nullptr) GTEST_SKIP() << kNoEtcd;
    url_ = EtcdNode::shared()->fresh_url();
    first_ = made();
    second_ = made();
  }
  [[nodiscard]] std::unique_ptr<Storage> made() const {
    auto storage = etcd_store::make_etcd_storage(url_);
    EXPECT_TRUE(storage) << storage.error().text();
    return std::move(*storage);
  }
  /// A change by a registry that has everything up to `seen`.
  static expected<std::uint64_t, names::StorageError> put(Storage& storage, const std::string& name,
                                                          std::uint64_t seen,
                                                          std::uint64_t expected,
                                                          Duration lease = {}) {
    const StoredName stored = named(name, seen + 1, lease);
    return storage.commit({name, &stored, seen + 1, true, expected});
  }
  static std::uint64_t revision_now(Storage& storage) {
    const auto content = storage.load();
    EXPECT_TRUE(content) << content.error().text();
    return content ? content->first_revision - 1 : 0;
  }

  std::string url_{};
  Followed told_{};  ///< Both outlive the storages that notify them.
  Followed told_second_{};
  std::unique_ptr<Storage> first_{};
  std::unique_ptr<Storage> second_{};
};

TEST_F(Shared, AppliesAChangeOnlyToTheRevisionThatItReplaces) {
  const std::uint64_t seen = revision_now(*first_);
  const auto content = second_->load();
  ASSERT_TRUE(content) << content.error().text();
  EXPECT_EQ(content->first_revision, seen + 1);
  EXPECT_EQ(content->identity, first_->load()->identity);
  const auto bound = put(*first_, "lab/arm0", seen, 0);
  ASSERT_TRUE(bound) << bound.error().text();
  const auto other = put(*second_, "lab/arm0", seen, 0);
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().kind, Kind::kConflict);
  const auto replaced = put(*second_, "lab/arm0", seen, *bound);
  ASSERT_TRUE(replaced);
  EXPECT_GT(*replaced, *bound);
  EXPECT_EQ(first_->commit({"lab/arm0", nullptr, *bound + 1, true, *bound}).error().kind,
            Kind::kConflict);
  EXPECT_TRUE(first_->confirm("lab/arm0", *replaced, kNever));
  EXPECT_EQ(first_->confirm("lab/arm0", 0, kNever).error().kind, Kind::kConflict);
  EXPECT_TRUE(first_->commit({"lab/arm0", nullptr, *replaced + 1, true, *replaced}));
  EXPECT_TRUE(second_->confirm("lab/arm0", 0, kNever));
}

TEST_F(Shared, BindsNothingAboveOrBelowABoundName) {
  const std::uint64_t seen = revision_now(*first_);
  static_cast<void>(revision_now(*second_));
  ASSERT_TRUE(put(*first_, "lab/arm0", seen, 0));
  for (const char* name : {"lab", "lab/arm0/x", "lab/arm0/x/y"}) {
    const auto refused = put(*second_, name, seen, 0);
    ASSERT_FALSE(refused) << name;
    EXPECT_EQ(refused.error().kind, Kind::kConflict) << name;
  }
  EXPECT_TRUE(put(*second_, "lab/arm00", seen, 0));
  EXPECT_TRUE(put(*second_, "lab/arm", seen, 0));
}

// A stopped node may execute a request long after it was repeated at another node.
TEST_F(Shared, RefusesALateRequestForAnUnboundName) {
  const std::uint64_t seen = revision_now(*first_);
  const auto bound = put(*first_, "lab/arm0", seen, 0);
  ASSERT_TRUE(bound);
  const auto unbound = first_->commit({"lab/arm0", nullptr, *bound + 1, true, *bound});
  ASSERT_TRUE(unbound);
  const auto late = put(*first_, "lab/arm0", seen, 0);
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().kind, Kind::kConflict);
  EXPECT_TRUE(put(*first_, "lab/arm0", *unbound, 0)) << "one who has seen the unbind may";
}

TEST_F(Shared, ReportsChangesInOneOrderAndThatItIsCurrent) {
  const std::uint64_t seen = revision_now(*first_);
  static_cast<void>(revision_now(*second_));
  ASSERT_TRUE(first_->follow(told_));
  ASSERT_TRUE(second_->follow(told_second_));
  constexpr int kCount = 20;
  const auto change = [&](Storage& storage, const std::string& prefix) {
    for (int i = 0; i < kCount; ++i)
      EXPECT_TRUE(put(storage, prefix + std::to_string(i), seen, 0));
  };
  std::thread other([&] { change(*second_, "b/n"); });
  change(*first_, "a/n");
  other.join();
  const auto told = told_.wait_for(2 * kCount);
  const auto same = told_second_.wait_for(2 * kCount);
  ASSERT_EQ(told.size(), std::size_t{2 * kCount});
  ASSERT_EQ(same.size(), told.size());
  for (std::size_t i = 0; i < told.size(); ++i) {
    EXPECT_EQ(told[i].name, same[i].name);
    EXPECT_EQ(told[i].revision, same[i].revision);
    EXPECT_EQ(told[i].stored, same[i].stored);
    EXPECT_EQ(told[i].stored->revision, told[i].revision) << "the holder's";
    EXPECT_TRUE(i == 0 || told[i].revision > told[i - 1].revision);
  }
  EXPECT_TRUE(becomes_current(*first_));
}

TEST_F(Shared, EndsTheLeaseOfANameThatNoRegistryRenews) {
  const std::uint64_t seen = revision_now(*first_);
  ASSERT_TRUE(first_->follow(told_));
  const auto bound = put(*first_, "lab/arm0", seen, 0, 100ms);
  ASSERT_TRUE(bound);
  ASSERT_EQ(told_.wait_for(1).size(), 1u);
  // A registry that joined later renews, too.
  static_cast<void>(revision_now(*second_));
  const StoredName stored = named("lab/arm0", *bound, 100ms);
  const auto renew = [&](Storage& storage, std::uint64_t expected) {
    return storage.renew({"lab/arm0", &stored, seen + 1, false, expected});
  };
  const auto renewed = renew(*second_, *bound);
  EXPECT_TRUE(renewed) << renewed.error().text();
  EXPECT_EQ(renew(*second_, *bound + 1).error().kind, Kind::kConflict);
  EXPECT_GE(told_.wait_for(1).front().stored->stay, 2s);
  const auto changes = told_.wait_for(2);
  ASSERT_EQ(changes.size(), 2u);
  EXPECT_FALSE(changes[1].stored);
  EXPECT_TRUE(changes[1].has_lapsed);
  EXPECT_EQ(renew(*first_, *bound).error().kind, Kind::kConflict);
}

TEST_F(Shared, ReportsAnUnboundName) {
  const std::uint64_t seen = revision_now(*first_);
  ASSERT_TRUE(first_->follow(told_));
  const auto bound = put(*first_, "lab/arm0", seen, 0, 10s);
  ASSERT_TRUE(bound);
  ASSERT_EQ(told_.wait_for(1).size(), 1u);
  ASSERT_TRUE(first_->commit({"lab/arm0", nullptr, *bound + 1, false, *bound}));
  // A later unbind of the same name changes the fence once more.
  const auto again = put(*first_, "lab/arm0", *bound + 1, 0, 10s);
  ASSERT_TRUE(again) << again.error().text();
  ASSERT_TRUE(first_->commit({"lab/arm0", nullptr, *again + 1, false, *again}));
  const auto changes = told_.wait_for(4);
  ASSERT_EQ(changes.size(), 4u);
  EXPECT_FALSE(changes[1].has_lapsed);
  EXPECT_FALSE(changes[3].has_lapsed);
}

/// A registry's storage in an etcd that is restored from a backup.
class Restored : public testing::Test {
 protected:
  void SetUp() override {
    node_ = EtcdNode::own();
    if (!node_) GTEST_SKIP() << kNoEtcd;
    url_ = node_->fresh_url();
    storage_ = made();
    seen_ = loaded(*storage_);
    const auto bound = put(*storage_, "lab/cam1", seen_);
    ASSERT_TRUE(bound) << bound.error().text();
    node_->back_up();
  }
  [[nodiscard]] std::unique_ptr<Storage> made() const {
    auto storage = etcd_store::make_etcd_storage(url_);
    EXPECT_TRUE(storage) << storage.error().text();
    return std::move(*storage);
  }
  static std::uint64_t loaded(Storage& storage) {
    const auto content = storage.load();
    EXPECT_TRUE(content) << content.error().text();
    return content ? content->first_revision - 1 : 0;
  }
  static expected<std::uint64_t, names::StorageError> put(Storage& storage, const std::string& name,
                                                          std::uint64_t seen) {
    const StoredName stored = named(name, seen + 1);
    return storage.commit({name, &stored, seen + 1, true, 0});
  }
  /// Binds lab/cam2 to lab/cam5, which the backup does not have.
  void bind_more() {
    for (int i = 2; i <= 5; ++i) {
      const auto bound = put(*storage_, "lab/cam" + std::to_string(i), seen_ + 100);
      ASSERT_TRUE(bound) << bound.error().text();
      last_ = *bound;
    }
  }

  std::unique_ptr<EtcdNode> node_{};
  Followed told_{};  ///< Outlives the storage that notifies it.
  std::string url_{};
  std::unique_ptr<Storage> storage_{};
  std::uint64_t seen_ = 0;
  std::uint64_t last_ = 0;
};

TEST_F(Restored, IsReadAgainWhenItsRevisionWentBack) {
  ASSERT_TRUE(storage_->follow(told_));
  bind_more();
  ASSERT_EQ(told_.wait_for(5).size(), 5u);
  node_->restore_backup();
  const auto restart = told_.wait_for_restart();
  ASSERT_TRUE(restart);
  EXPECT_TRUE(restart->is_replaced);
  ASSERT_EQ(restart->names.size(), 1u);
  EXPECT_EQ(restart->names[0].name, "lab/cam1");
  EXPECT_LT(restart->revision, last_);
  // A lost name can be bound again, and is reported.
  const auto bound = put(*storage_, "lab/cam5", restart->revision);
  ASSERT_TRUE(bound) << bound.error().text();
  const auto changes = told_.wait_for(6);
  ASSERT_EQ(changes.size(), 6u);
  EXPECT_EQ(changes[5].name, "lab/cam5");
  EXPECT_EQ(changes[5].revision, *bound);
  EXPECT_TRUE(becomes_current(*storage_));
}

// Other registries have changed it meanwhile, so that its revision does not show it.
TEST_F(Restored, IsReadAgainWhenOthersHaveUsedTheSameRevisions) {
  bind_more();
  static_cast<void>(loaded(*storage_));
  node_->restore_backup();
  const auto other = made();
  const std::uint64_t seen = loaded(*other);
  for (int i = 2; i <= 6; ++i)
    ASSERT_TRUE(put(*other, "lab/lamp" + std::to_string(i), seen + 100));
  ASSERT_TRUE(storage_->follow(told_));
  const auto restart = told_.wait_for_restart();
  ASSERT_TRUE(restart);
  EXPECT_TRUE(restart->is_replaced);
  EXPECT_GT(restart->revision, last_);
  ASSERT_EQ(restart->names.size(), 6u);
  EXPECT_EQ(restart->names.back().name, "lab/lamp6");
}

TEST_F(Restored, IsReadAgainWhenItIsEmptyOrAnotherCluster) {
  ASSERT_TRUE(storage_->follow(told_));
  std::size_t told_count = 1;
  for (const char* token : {"one", "another"}) {
    ASSERT_EQ(told_.wait_for(told_count).size(), told_count);
    ++told_count;
    node_->restore_nothing(token);
    const auto restart = told_.wait_for_restart();
    ASSERT_TRUE(restart) << token;
    EXPECT_TRUE(restart->is_replaced);
    EXPECT_TRUE(restart->names.empty());
    const auto bound = put(*storage_, "lab/cam1", restart->revision);
    ASSERT_TRUE(bound) << bound.error().text();
  }
}

}  // namespace
}  // namespace rtpm::storage_test
