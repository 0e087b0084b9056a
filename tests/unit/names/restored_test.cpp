// Registries whose shared storage is restored from a backup at run time: simulated, with seeds.
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "registry_fixture.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/storage.hpp"
#include "rtpm/names/watch.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;
using NamesAndUrls = std::map<std::string, std::string>;

constexpr Owner kOwner{.id = 1, .epoch = 1};

/// The registries' shared storage. It reports changes at once, and a restoration when noticed.
class Cluster {
 public:
  struct State {
    std::map<std::string, StoredName, std::less<>> names{};
    std::uint64_t revision = 1;
  };

  [[nodiscard]] State state() {
    const std::lock_guard lock(mutex_);
    return state_;
  }
  void restore(State state) {
    const std::lock_guard lock(mutex_);
    state_ = std::move(state);
    for (Informed& each : followers_)
      each.has_noticed = false;
  }
  /// Makes the registry with this number notice that the storage was restored.
  void notice(std::size_t number) {
    const std::lock_guard lock(mutex_);
    Informed& reported = followers_.at(number);
    reported.has_noticed = true;
    reported.follower->on_restart(values(), state_.revision, /*is_replaced=*/true);
  }
  void add(Storage::Follower& follower) {
    const std::lock_guard lock(mutex_);
    followers_.push_back({&follower, true});
  }
  [[nodiscard]] StoredContent content() {
    const std::lock_guard lock(mutex_);
    return {.names = values(),
            .first_revision = state_.revision + 1,
            .identity = 7,
            .place = "simulated"};
  }
  expected<std::uint64_t, StorageError> commit(const StoredChange& change) {
    const std::lock_guard lock(mutex_);
    const auto found = state_.names.find(change.name);
    const std::uint64_t now = found == state_.names.end() ? 0 : found->second.change;
    if (now != change.expected) return unexpected{conflict()};
    const std::uint64_t revision = ++state_.revision;
    ReportedChange reported{std::string(change.name), revision, std::nullopt};
    if (found != state_.names.end()) state_.names.erase(found);
    if (change.stored != nullptr) {
      StoredName stored = *change.stored;
      stored.change = revision;
      if (stored.revision == change.revision) stored.revision = revision;
      reported.stored = stored;
      state_.names.emplace(change.name, std::move(stored));
    }
    for (Informed& each : followers_) {
      if (!each.has_noticed) continue;
      each.follower->on_changes({reported});
    }
    return revision;
  }
  expected<void, StorageError> confirm(std::string_view name, std::uint64_t change) {
    const std::lock_guard lock(mutex_);
    const auto found = state_.names.find(name);
    const std::uint64_t now = found == state_.names.end() ? 0 : found->second.change;
    if (now == change) return {};
    return unexpected{conflict()};
  }

 private:
  struct Informed {
    Storage::Follower* follower;
    bool has_noticed;
  };
  static StorageError conflict() {
    return {{"another was first", {}, {}}, StorageError::Kind::kConflict};
  }
  [[nodiscard]] std::vector<StoredName> values() const {
    std::vector<StoredName> all;
    for (const auto& [name, stored] : state_.names)
      all.push_back(stored);
    return all;
  }

  std::mutex mutex_;
  State state_{};
  std::vector<Informed> followers_{};
};

class SimulatedStorage final : public Storage {
 public:
  explicit SimulatedStorage(Cluster& cluster) : cluster_(cluster) {}
  expected<StoredContent, SetupError> load() override { return cluster_.content(); }
  expected<void, SetupError> follow(Follower& follower) override {
    follower_ = &follower;
    cluster_.add(follower);
    return {};
  }
  bool reports_changes() const noexcept override { return true; }
  expected<std::uint64_t, StorageError> commit(const StoredChange& change) override {
    const Unlocked unlocked(follower_);
    return cluster_.commit(change);
  }
  expected<void, StorageError> renew(const StoredChange& change) override {
    return confirm(change.name, change.expected, change.deadline);
  }
  expected<void, StorageError> confirm(std::string_view name, std::uint64_t change,
                                       MonotonicTime) override {
    const Unlocked unlocked(follower_);
    return cluster_.confirm(name, change);
  }

 private:
  Follower* follower_ = nullptr;
  Cluster& cluster_;
};

/// Two registries with one storage, and a watch at each.
class Site {
 public:
  explicit Site(std::uint64_t seed) : random_(seed) {
    for (Registry& each : registries_)
      start(each);
  }

  void change() {
    Registry& at = registries_[pick(2)];
    const std::string name = "lab/n" + std::to_string(pick(6));
    if (pick(3) == 0) {
      static_cast<void>(at.directory->unbind(name, kOwner));
    } else {
      static_cast<void>(bind(at, name));
    }
  }
  void back_up() { backup_ = cluster_.state(); }
  /// Makes some changes, perhaps, before both registries have noticed.
  void restore() {
    if (!backup_) return;
    cluster_.restore(*backup_);
    const std::size_t first = pick(2);
    cluster_.notice(first);
    for (std::size_t i = pick(4); i > 0; --i)
      static_cast<void>(bind(registries_[first], "lab/n" + std::to_string(pick(6))));
    cluster_.notice(1 - first);
  }
  /// The faults in the contents of registries and watches; empty if there are none.
  [[nodiscard]] std::string faults() {
    NamesAndUrls all;
    for (const auto& [name, stored] : cluster_.state().names)
      all.emplace(name, stored.url);
    for (Registry& each : registries_) {
      const auto listed = each.directory->list();
      if (!listed) return listed.error().text();
      NamesAndUrls names;
      for (const NameEntry& entry : *listed)
        names.emplace(entry.name, entry.url);
      if (names != all) return "a registry lists what is not stored";
      if (!test::await([&] { return each.watched() == all; }, 5s)) {
        return "a watch has " + std::to_string(each.watched().size()) + " of " +
               std::to_string(all.size()) + " names, or others";
      }
    }
    return {};
  }
  /// Checks that every name can be bound, and that both registries see it.
  [[nodiscard]] std::string faults_of_binding() {
    for (int i = 0; i < 6; ++i) {
      const std::string name = "lab/n" + std::to_string(i);
      const auto bound = bind(registries_[pick(2)], name);
      if (!bound) return name + ": " + bound.error().text();
    }
    return faults();
  }

 private:
  struct Registry {
    std::unique_ptr<rpc::Servant> servant{};
    std::optional<ServedRegistry> served{};
    std::optional<Directory> directory{};
    std::mutex mutex{};
    NamesAndUrls reported{};
    std::unique_ptr<NameWatch> watch{};
    [[nodiscard]] NamesAndUrls watched() {
      const std::lock_guard lock(mutex);
      return reported;
    }
  };

  void start(Registry& each) {
    auto made = make_registry({.report = [](std::string_view) {},
                               .storage = std::make_unique<SimulatedStorage>(cluster_)});
    ASSERT_TRUE(made) << made.error().text();
    each.servant = std::move(*made);
    each.served.emplace(*each.servant);
    each.directory.emplace(node_, each.served->url());
    auto watch = NameWatch::start(node_, each.served->url(), {},
                                  {.on_change = [&each](const NameChange& change) {
                                    const std::lock_guard lock(each.mutex);
                                    each.reported.erase(change.entry.name);
                                    if (change.kind != NameChange::Kind::kGone)
                                      each.reported.emplace(change.entry.name, change.entry.url);
                                  }});
    ASSERT_TRUE(watch) << watch.error().text();
    each.watch = std::move(*watch);
  }
  [[nodiscard]] expected<Granted, DirectoryError> bind(Registry& at, const std::string& name) {
    const std::string url = "rtpm://10.0.0.1:1/p" + std::to_string(++url_count_);
    Claim claim{name, url, "lab.Arm", kOwner};
    claim.is_permanent = true;
    return at.directory->bind(claim);
  }
  [[nodiscard]] std::size_t pick(std::size_t count) { return random_() % count; }

  std::mt19937_64 random_;
  Cluster cluster_;
  std::optional<Cluster::State> backup_{};
  rpc::Node node_{{.wait = {.strategy = rt::WaitStrategy::kBlock}, .collocates = false}};
  std::array<Registry, 2> registries_{};
  int url_count_ = 0;
};

TEST(RestoredStorage, RegistriesAndWatchesConvergeToTheRestoredState) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Site site(seed);
    std::mt19937_64 random(seed);
    for (int round = 0; round < 3; ++round) {
      for (int i = 0; i < 4; ++i)
        site.change();
      site.back_up();
      for (std::uint64_t i = random() % 6; i > 0; --i)
        site.change();
      site.restore();
      ASSERT_EQ(site.faults(), "");
      for (int i = 0; i < 3; ++i)
        site.change();
      ASSERT_EQ(site.faults(), "");
    }
    ASSERT_EQ(site.faults_of_binding(), "");
  }
}

}  // namespace
}  // namespace rtpm::names
