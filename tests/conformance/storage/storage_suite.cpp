#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "etcd_node.hpp"
#include "rtpm/etcd_store/etcd_storage.hpp"
#include "rtpm/file_store/file_storage.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/lapsed.hpp"
#include "rtpm/names/servant.hpp"
#include "rtpm/names/watch.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"

// Callers see the same behaviour with every storage of a registry's names.
namespace rtpm::storage_test {
namespace {

using namespace std::chrono_literals;
using names::Claim;
using names::Outcome;

constexpr names::Owner kOwner{.id = 1, .epoch = 1};
constexpr names::Owner kOther{.id = 2, .epoch = 1};
constexpr const char* kUrl = "rtpm://10.0.0.1:1/p";
constexpr const char* kOtherUrl = "rtpm://10.0.0.1:1/q";

Claim permanent(std::string_view name, names::Owner owner = kOwner, std::string_view url = kUrl) {
  Claim claim{name, url, "lab.Arm", owner};
  claim.is_permanent = true;
  return claim;
}
Claim leased(std::string_view name, names::Owner owner = kOwner) {
  return {name, kUrl, "lab.Arm", owner, 2s};
}

/// Makes registries on the same storage.
class Place {
 public:
  explicit Place(const std::string& kind) : kind_(kind) {
    folder_ = (std::filesystem::temp_directory_path() / "rtpm-storage-XXXXXX").string();
    if (::mkdtemp(folder_.data()) == nullptr) folder_.clear();
    if (kind == "etcd" && EtcdNode::shared() != nullptr) url_ = EtcdNode::shared()->fresh_url();
  }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;
  ~Place() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  [[nodiscard]] bool is_there() const { return kind_ != "etcd" || !url_.empty(); }
  [[nodiscard]] names::RegistryConfig config() const {
    names::RegistryConfig config;
    config.report = [](std::string_view) {};
    if (kind_ == "file") config.storage = file_store::make_file_storage(folder_ + "/names.db");
    if (kind_ == "etcd") {
      auto storage = etcd_store::make_etcd_storage(url_);
      EXPECT_TRUE(storage);
      config.storage = std::move(*storage);
    }
    return config;
  }

 private:
  std::string kind_;
  std::string folder_{};
  std::string url_{};
};

class EveryStorage : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!place_.is_there()) GTEST_SKIP() << kNoEtcd;
    start();
  }
  void start() {
    auto made = names::make_registry(place_.config());
    ASSERT_TRUE(made) << made.error().text();
    registry_ = std::move(*made);
    auto server = rpc::Server::create(
        {.name = "registry", .port = port_, .realtime = rt::RealtimeMode::kOff});
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    ASSERT_TRUE(server_->add(names::kRegistryPath, *registry_));
    ASSERT_TRUE(server_->start());
    port_ = server_->port();
    directory_.emplace(node_, server_->url(names::kRegistryPath));
  }
  void restart() {
    server_.reset();
    registry_.reset();
    start();
  }

  Place place_{GetParam()};
  std::uint16_t port_ = 0;
  std::unique_ptr<rpc::Servant> registry_{};
  std::unique_ptr<rpc::Server> server_{};
  rpc::Node node_{{.wait = {.strategy = rt::WaitStrategy::kBlock}, .collocates = false}};
  std::optional<names::Directory> directory_{};
};

INSTANTIATE_TEST_SUITE_P(Names, EveryStorage, testing::Values("memory", "file", "etcd"),
                         [](const auto& kind) { return kind.param; });

Outcome outcome_of(const auto& result) {
  if (result) return Outcome::kDone;
  return result.error().outcome.value_or(Outcome::kDenied);
}

TEST_P(EveryStorage, BindsAndFindsAndUnbinds) {
  Claim claim = permanent("lab/arm0");
  const std::vector<names::Property> properties{
      {"force", 3.5, "newton"},
      {"text", std::string("it's")},
      {"axes", names::PropertyList{names::PropertyType::kText, {"x", "y"}}},
      {"none", names::PropertyList{names::PropertyType::kReal, {}}},
      {"ready", names::PropertyList{names::PropertyType::kBool, {true, false}}},
      {"limits", names::PropertyList{names::PropertyType::kInteger, {std::int64_t{-1}}}},
      {"gains", names::PropertyList{names::PropertyType::kReal, {0.5, 2.0}}},
      {"free", true},
      {"least", std::int64_t{-9'223'372'036'854'775'807}}};
  claim.properties = properties;
  const auto bound = directory_->bind(claim);
  ASSERT_TRUE(bound) << bound.error().text();
  const auto described = directory_->describe("lab/arm0");
  ASSERT_TRUE(described) << described.error().text();
  EXPECT_EQ(described->url, kUrl);
  EXPECT_EQ(described->properties, properties);
  EXPECT_EQ(described->revision, bound->revision);
  EXPECT_EQ(described->stale_for, Duration{0});
  EXPECT_TRUE(described->is_permanent);
  EXPECT_EQ(directory_->find({.predicate = "force > 3"})->entries.size(), 1u);
  ASSERT_TRUE(directory_->unbind("lab/arm0", kOwner));
  EXPECT_EQ(outcome_of(directory_->resolve("lab/arm0")), Outcome::kNotFound);
  EXPECT_TRUE(directory_->list()->empty());
  EXPECT_EQ(outcome_of(directory_->unbind("lab/arm0", kOwner)), Outcome::kNotFound);
}

TEST_P(EveryStorage, RefusesNamesThatBreakTheRules) {
  const auto bound = directory_->bind(permanent("lab/arm0"));
  ASSERT_TRUE(bound);
  const auto refused = directory_->bind(permanent("lab/arm0", kOther));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().outcome, Outcome::kAlreadyBound);
  EXPECT_EQ(refused.error().holder_url, kUrl);
  EXPECT_EQ(refused.error().holder_revision, bound->revision);
  EXPECT_EQ(outcome_of(directory_->bind(permanent("lab/arm0/x"))), Outcome::kNotADirectory);
  EXPECT_EQ(outcome_of(directory_->bind(permanent("lab"))), Outcome::kIsADirectory);
  EXPECT_EQ(outcome_of(directory_->bind(permanent("lab//x"))), Outcome::kBadName);
  EXPECT_EQ(outcome_of(directory_->renew("lab/arm1", kOwner, 2s)), Outcome::kNotFound);
  EXPECT_EQ(outcome_of(directory_->renew("lab/arm0", kOther, 2s)), Outcome::kNotOwner);
  EXPECT_EQ(outcome_of(directory_->unbind("lab/arm0", kOther)), Outcome::kNotOwner);
  EXPECT_EQ(outcome_of(directory_->unbind("lab/arm0", kOther, bound->revision + 1)),
            Outcome::kStaleRevision);
  EXPECT_EQ(directory_->resolve("lab/arm0")->revision, bound->revision);
}

TEST_P(EveryStorage, KeepsTheRevisionWhileTheHolderStays) {
  const auto first = directory_->bind(permanent("lab/arm0"));
  ASSERT_TRUE(first);
  EXPECT_EQ(directory_->bind(permanent("lab/arm0"))->revision, first->revision);
  EXPECT_EQ(directory_->bind(permanent("lab/arm0", kOwner, kOtherUrl))->revision, first->revision);
  EXPECT_EQ(directory_->resolve("lab/arm0")->url, kOtherUrl);
  Claim taking = permanent("lab/arm0", kOther);
  EXPECT_EQ(outcome_of(directory_->rebind(taking)), Outcome::kAlreadyBound);
  taking.holder_revision = first->revision;
  const auto taken = directory_->rebind(taking);
  ASSERT_TRUE(taken) << taken.error().text();
  EXPECT_GT(taken->revision, first->revision);
  EXPECT_EQ(outcome_of(directory_->unbind("lab/arm0", kOther, first->revision)),
            Outcome::kStaleRevision);
  EXPECT_TRUE(directory_->unbind("lab/arm0", kOwner, taken->revision));
  EXPECT_GT(directory_->bind(permanent("lab/arm0"))->revision, taken->revision);
}

TEST_P(EveryStorage, EndsALeaseThatIsNotRenewed) {
  ASSERT_TRUE(directory_->bind(leased("lab/renewed")));
  ASSERT_TRUE(directory_->bind(leased("lab/left")));
  const auto entry = directory_->resolve("lab/left");
  ASSERT_TRUE(entry);
  EXPECT_GT(entry->lease_left, Duration{0});
  EXPECT_TRUE(test::await([&] {
    EXPECT_TRUE(directory_->renew("lab/renewed", kOwner, 2s));
    rt::sleep_until(rt::now() + 100ms);
    return !directory_->resolve("lab/left");
  }));
  EXPECT_TRUE(directory_->resolve("lab/renewed"));
  // Another owner then gets it, and its former owner no longer renews it.
  ASSERT_TRUE(directory_->bind(leased("lab/left", kOther)));
  EXPECT_EQ(outcome_of(directory_->renew("lab/left", kOwner, 2s)), Outcome::kNotOwner);
}

TEST_P(EveryStorage, KeepsANameWhoseLeaseEndedAsLostUntilItIsBoundOrDismissed) {
  const auto lost = [&] {
    return names::ask_for_lapsed(node_, server_->url(names::kRegistryPath), rt::now() + 5s).names;
  };
  const auto lost_count = [&] { return lost().size(); };
  for (const char* name : {"lab/left", "lab/back", "lab/ended"})
    ASSERT_TRUE(directory_->bind(leased(name)));
  const auto bound = directory_->resolve("lab/left");
  ASSERT_TRUE(directory_->unbind("lab/ended", kOwner));
  EXPECT_TRUE(test::await([&] { return lost_count() == 2; }));
  ASSERT_TRUE(directory_->bind(permanent("lab/back")));
  ASSERT_EQ(lost_count(), 1u) << "lab/ended was unbound, lab/back is bound again";
  // etcd does not keep them for registries that start.
  if (std::string_view(GetParam()) == "file") restart();
  ASSERT_EQ(lost_count(), 1u);
  const names::LapsedName left = lost().front();
  EXPECT_EQ(left.name, "lab/left");
  EXPECT_EQ(left.url, kUrl);
  EXPECT_EQ(left.interface, "lab.Arm");
  EXPECT_EQ(left.revision, bound->revision);
  EXPECT_GE(left.lapsed_for, Duration{0});
  EXPECT_EQ(outcome_of(directory_->unbind("lab/left", kOther)), Outcome::kNotFound);
  EXPECT_TRUE(names::dismiss(node_, left));
  EXPECT_EQ(lost_count(), 0u);
  if (std::string_view(GetParam()) == "file") restart();
  EXPECT_EQ(lost_count(), 0u);
}

TEST_P(EveryStorage, ReportsEveryChangeInOrderToWatchers) {
  std::mutex mutex;
  std::vector<std::string> told;
  const auto watch = names::NameWatch::start(
      node_, server_->url(names::kRegistryPath), {}, {.on_change = [&](const auto& change) {
        constexpr const char* kWords[] = {"bound ", "changed ", "gone "};
        const std::lock_guard lock(mutex);
        told.push_back(kWords[static_cast<int>(change.kind)] + change.entry.name);
      }});
  ASSERT_TRUE(watch) << watch.error().text();
  ASSERT_TRUE(directory_->bind(leased("lab/arm0")));
  ASSERT_TRUE(directory_->bind(permanent("lab/arm1")));
  ASSERT_TRUE(directory_->bind(permanent("lab/arm1", kOwner, kOtherUrl)));
  ASSERT_TRUE(directory_->bind(leased("lab/arm0")));  // Changes nothing but the lease.
  ASSERT_TRUE(directory_->renew("lab/arm0", kOwner, 3s));
  ASSERT_TRUE(directory_->unbind("lab/arm1", kOwner));
  ASSERT_TRUE(directory_->unbind("lab/arm0", kOwner));
  const std::vector<std::string> all{"bound lab/arm0", "bound lab/arm1", "changed lab/arm1",
                                     "gone lab/arm1", "gone lab/arm0"};
  EXPECT_TRUE(test::await([&] {
    const std::lock_guard lock(mutex);
    return told.size() >= all.size();
  }));
  const std::lock_guard lock(mutex);
  EXPECT_EQ(told, all);
}

TEST_P(EveryStorage, KeepsPermanentNamesOverARestart) {
  if (std::string_view(GetParam()) == "memory") return;
  const auto bound = directory_->bind(permanent("lab/arm0"));
  ASSERT_TRUE(bound);
  ASSERT_TRUE(directory_->bind(permanent("lab/arm1")));
  ASSERT_TRUE(directory_->unbind("lab/arm1", kOwner));
  ASSERT_TRUE(directory_->bind({"lab/arm2", kUrl, "lab.Arm", kOwner, 10s}));
  restart();
  const auto found = directory_->list();
  ASSERT_TRUE(found) << found.error().text();
  ASSERT_EQ(found->size(), 2u);
  EXPECT_EQ((*found)[0].name, "lab/arm0");
  EXPECT_EQ((*found)[0].revision, bound->revision);
  EXPECT_TRUE(directory_->renew("lab/arm2", kOwner, 2s));
  EXPECT_GT(directory_->bind(permanent("lab/arm1"))->revision, bound->revision);
}

}  // namespace
}  // namespace rtpm::storage_test
