#include <gtest/gtest.h>
#include <signal.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "etcd_cluster.hpp"
#include "names.rtpm.hpp"
#include "programs.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/names/watch.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"

// Two registries in front of three nodes of etcd, which are killed, stopped and cut off under load:
// no acknowledged change is lost, none comes back, and both registries end with the same names.
namespace rtpm::system_test {
namespace {

using namespace std::chrono_literals;

constexpr int kRegistryCount = 2;
constexpr Duration kFaultTime = 2500ms;

/// Rounds of the storm: RTPM_ETCD_ROUNDS, otherwise three of the four faults.
int round_count() {
  const char* const text = std::getenv("RTPM_ETCD_ROUNDS");
  return text == nullptr ? 3 : std::atoi(text);
}

using State = std::map<std::string, std::string>;  ///< URLs of names.
/// The successive URLs of each name; an empty URL means that the name was unbound.
using History = std::map<std::string, std::vector<std::string>>;

/// A registry that follows etcd, with the reports of a watch at it.
class WatchedRegistry {
 public:
  explicit WatchedRegistry(const std::string& store) { start(store); }

  void kill() {
    daemon_->process.send_signal(SIGKILL);
    ASSERT_TRUE(daemon_->process.wait(kPatience));
  }
  void freeze() { daemon_->process.stop(); }
  void thaw() { daemon_->process.send_signal(SIGCONT); }
  void watch() {
    auto watch = names::NameWatch::start(
        node_, url(), {.deadline = 5s},
        {.on_change = [this](const names::NameChange& change) { note(change); }});
    ASSERT_TRUE(watch) << watch.error().text();
    watch_ = std::move(*watch);
  }

  [[nodiscard]] std::string url() const { return daemon_->url; }
  [[nodiscard]] State told() {
    const std::lock_guard lock(mutex_);
    return told_;
  }
  [[nodiscard]] std::vector<std::string> changes() {
    const std::lock_guard lock(mutex_);
    return changes_;
  }
  [[nodiscard]] History history() {
    const std::lock_guard lock(mutex_);
    return history_;
  }
  [[nodiscard]] std::uint64_t state_count() const { return watch_->state_count(); }
  [[nodiscard]] std::optional<State> listed() {
    const auto found = names::Directory(node_, url()).contents();
    if (!found || found->stale_for > Duration{0}) return std::nullopt;
    State state;
    for (const names::NameEntry& entry : found->entries)
      state[entry.name] = entry.url;
    return state;
  }
  [[nodiscard]] bool is_stale() {
    const auto found = names::Directory(node_, url()).contents();
    return found && found->stale_for > Duration{0};
  }
  [[nodiscard]] names::Directory directory(Duration deadline = 1s) {
    return names::Directory(node_, url(), deadline);
  }
  [[nodiscard]] rpc::Node& node() { return node_; }

 private:
  void start(const std::string& store) {
    auto daemon =
        start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off", "--store", store});
    ASSERT_TRUE(daemon);
    daemon_.emplace(std::move(*daemon));
  }
  void note(const names::NameChange& change) {
    const std::lock_guard lock(mutex_);
    const bool is_gone = change.kind == names::NameChange::Kind::kGone;
    changes_.push_back(change.entry.name + (is_gone ? " gone" : " " + change.entry.url));
    history_[change.entry.name].push_back(is_gone ? "" : change.entry.url);
    if (is_gone) {
      told_.erase(change.entry.name);
    } else {
      told_[change.entry.name] = change.entry.url;
    }
  }

  std::optional<Daemon> daemon_{};
  rpc::Node node_{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  std::mutex mutex_;
  State told_{};
  std::vector<std::string> changes_{};
  History history_{};
  std::unique_ptr<names::NameWatch> watch_{};
};

/// Callers that change names of their own, at either registry, each until it is acknowledged.
class Callers {
 public:
  static constexpr int kCallerCount = 4;
  static constexpr int kNamesPerCaller = 6;
  static constexpr std::size_t kLeasedCount = 3;

  /// @param before  the names left by an earlier round
  Callers(std::array<std::string, kRegistryCount> urls, const State& before, History& history,
          int round)
      : urls_(std::move(urls)), before_(before), history_(history), round_(round) {
    for (int caller = 0; caller < kCallerCount; ++caller)
      threads_.emplace_back([this, caller] { change_names(caller); });
    threads_.emplace_back([this] { keep_leases(); });
  }
  ~Callers() { end(); }
  /// Ends the callers once all requested changes are acknowledged.
  void end() {
    is_ending_ = true;
    for (std::thread& thread : threads_)
      thread.join();
    threads_.clear();
  }

  /// The results are valid after end().
  [[nodiscard]] const State& acknowledged() const { return acknowledged_; }
  [[nodiscard]] std::uint64_t change_count() const { return change_count_; }
  [[nodiscard]] std::uint64_t unknown_count() const { return unknown_count_; }
  [[nodiscard]] std::uint64_t renewal_count() const { return renewal_count_; }
  [[nodiscard]] std::uint64_t lost_lease_count() const { return lost_lease_count_; }

 private:
  using Directories = std::vector<names::Directory>;
  [[nodiscard]] Directories directories(rpc::Node& node) const {
    Directories made;
    for (const std::string& url : urls_)
      made.emplace_back(node, url, 700ms);
    return made;
  }

  /// Asks registry after registry until one returns an outcome.
  template <class Operation>
  std::optional<names::Outcome> insist(Directories& directories, std::mt19937_64& random,
                                       Operation operation) {
    const MonotonicTime give_up = rt::now() + kPatience;
    std::size_t which = random() % directories.size();
    while (rt::now() < give_up) {
      const auto done = operation(directories[which]);
      if (done) return names::Outcome::kDone;
      const auto outcome = done.error().outcome;
      if (outcome && *outcome != names::Outcome::kStoreUnreachable) return outcome;
      ++unknown_count_;
      which = (which + 1) % directories.size();
      rt::sleep_until(rt::now() + 20ms);
    }
    ADD_FAILURE() << "no registry acknowledges a change";
    return std::nullopt;
  }

  void change_names(int caller) {
    rpc::Node node{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
    Directories registries = directories(node);
    std::mt19937_64 random(static_cast<std::uint64_t>(round_ * kCallerCount + caller));
    const names::Owner owner{.id = static_cast<std::uint64_t>(caller) + 1, .epoch = 1};
    State own;
    for (const auto& [name, url] : before_) {
      if (name.starts_with("c" + std::to_string(caller) + "/")) own[name] = url;
    }
    while (!is_ending_) {
      const std::string name =
          "c" + std::to_string(caller) + "/n" + std::to_string(random() % kNamesPerCaller);
      if (own.contains(name) && random() % 2 == 0) {
        int tries = 0;
        const auto outcome = insist(registries, random, [&](names::Directory& directory) {
          ++tries;
          return directory.unbind(name, owner);
        });
        // An earlier attempt without an answer may have unbound the name.
        EXPECT_TRUE(outcome == names::Outcome::kDone ||
                    (outcome == names::Outcome::kNotFound && tries > 1))
            << name << " after " << tries << " tries";
        own.erase(name);
        note(name, "");
      } else {
        const std::string url = "rtpm://10.0.0.1:1/v" + std::to_string(random());
        names::Claim claim{name, url, "lab.Arm", owner};
        claim.is_permanent = true;
        const auto outcome = insist(
            registries, random, [&](names::Directory& directory) { return directory.bind(claim); });
        EXPECT_EQ(outcome, names::Outcome::kDone) << name;
        own[name] = url;
        note(name, url);
      }
      ++change_count_;
    }
    const std::lock_guard lock(mutex_);
    acknowledged_.merge(own);
  }

  void note(const std::string& name, const std::string& url) {
    const std::lock_guard lock(mutex_);
    history_[name].push_back(url);
  }

  // Binds leased names once, and only renews them from then on.
  void keep_leases() {
    rpc::Node node{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
    Directories registries = directories(node);
    std::mt19937_64 random(99);
    constexpr Duration kLease = 8s;
    State own;
    for (std::uint64_t i = 0; i < kLeasedCount; ++i) {
      const std::string name = "leased/n" + std::to_string(i);
      const std::string url = "rtpm://10.0.0.2:1/o" + std::to_string(i);
      const auto bound = insist(registries, random, [&](names::Directory& directory) {
        return directory.bind({name, url, "lab.Arm", {100 + i, 1}, kLease});
      });
      EXPECT_EQ(bound, names::Outcome::kDone);
      own[name] = url;
      if (!before_.contains(name)) note(name, url);
    }
    while (!is_ending_) {
      for (std::uint64_t i = 0; i < kLeasedCount; ++i) {
        const auto renewed = insist(registries, random, [&](names::Directory& directory) {
          return directory.renew("leased/n" + std::to_string(i), {100 + i, 1}, kLease);
        });
        ++renewal_count_;
        if (renewed != names::Outcome::kDone) ++lost_lease_count_;
      }
      rt::sleep_until(rt::now() + 200ms);
    }
    const std::lock_guard lock(mutex_);
    acknowledged_.merge(own);
  }

  std::array<std::string, kRegistryCount> urls_;
  const State before_;
  History& history_;
  const int round_;
  std::atomic<bool> is_ending_ = false;
  std::atomic<std::uint64_t> change_count_ = 0;
  std::atomic<std::uint64_t> unknown_count_ = 0;
  std::atomic<std::uint64_t> renewal_count_ = 0;
  std::atomic<std::uint64_t> lost_lease_count_ = 0;
  std::mutex mutex_;
  State acknowledged_{};
  std::vector<std::thread> threads_{};
};

/// One fault of one node, and its end.
void strike(EtcdCluster& cluster, int round, std::mt19937_64& random) {
  const int leader = cluster.await_leader();
  ASSERT_GE(leader, 0) << "there is no leader";
  const int other = (leader + 1 + static_cast<int>(random() % 2)) % EtcdCluster::kNodeCount;
  const auto wait = [] { rt::sleep_until(rt::now() + kFaultTime); };
  switch (round % 4) {
    case 0:
      cluster.kill(leader);
      wait();
      cluster.start(leader);
      break;
    case 1:
      cluster.part_from_nodes(leader);
      wait();
      cluster.heal(leader);
      break;
    case 2:
      cluster.cut_off(random() % 2 == 0 ? leader : other);
      wait();
      cluster.heal(leader);
      cluster.heal(other);
      break;
    default:
      cluster.freeze(leader);
      wait();
      cluster.thaw(leader);
      break;
  }
  ASSERT_GE(cluster.await_leader(), 0) << "no leader after the fault";
}

/// Checks that a watch reported the changes of a name that were acknowledged.
void expect_same(const std::string& name, const std::vector<std::string>& told,
                 const std::vector<std::string>& acknowledged) {
  std::size_t i = 0;
  while (i < told.size() && i < acknowledged.size() && told[i] == acknowledged[i])
    ++i;
  if (i == told.size() && i == acknowledged.size()) return;
  std::string text = name + ", from its change " + std::to_string(i) + " on; told:";
  for (std::size_t j = i < 2 ? 0 : i - 2; j < told.size() && j < i + 5; ++j)
    text += " '" + told[j] + "'";
  text += "; acknowledged:";
  for (std::size_t j = i < 2 ? 0 : i - 2; j < acknowledged.size() && j < i + 5; ++j)
    text += " '" + acknowledged[j] + "'";
  ADD_FAILURE() << text;
}

TEST(EtcdStorm, LosesNoAcknowledgedChangeAndRegistriesAgree) {
  if (const auto missing = EtcdCluster::missing()) GTEST_SKIP() << *missing;
  EtcdCluster cluster;
  ASSERT_GE(cluster.await_leader(), 0);
  std::array<WatchedRegistry, kRegistryCount> registries{WatchedRegistry(cluster.url()),
                                                         WatchedRegistry(cluster.url())};
  for (WatchedRegistry& registry : registries)
    registry.watch();
  std::mt19937_64 random(7);
  std::uint64_t changes = 0;
  std::uint64_t unknown = 0;
  std::uint64_t renewals = 0;
  int lost = 0;
  int differing = 0;
  State before;
  History acknowledged;
  for (int round = 0; round < round_count() && !testing::Test::HasFatalFailure(); ++round) {
    Callers callers({registries[0].url(), registries[1].url()}, before, acknowledged, round);
    strike(cluster, round, random);
    rt::sleep_until(rt::now() + 300ms);
    callers.end();
    changes += callers.change_count();
    unknown += callers.unknown_count();
    renewals += callers.renewal_count();
    EXPECT_EQ(callers.lost_lease_count(), 0u) << "a leased name went though it was renewed";
    const State expected = callers.acknowledged();
    before = expected;
    // The watch settles; then both have exactly the acknowledged names.
    std::array<State, kRegistryCount> found{};
    for (std::size_t i = 0; i < found.size(); ++i) {
      static_cast<void>(test::await([&] {
        const auto listed = registries[i].listed();
        if (listed) found[i] = *listed;
        return listed && *listed == expected && registries[i].told() == expected;
      }));
      for (const auto& [name, url] : expected) {
        if (found[i][name] != url) {
          ++lost;
          ADD_FAILURE() << "round " << round << ", registry " << i << ": " << name << " is '"
                        << found[i][name] << "', acknowledged was '" << url << "'";
        }
      }
      EXPECT_EQ(registries[i].told(), expected) << "what the watch at registry " << i << " told";
    }
    if (registries[0].listed() != registries[1].listed()) ++differing;
    EXPECT_EQ(registries[0].listed(), expected);
    EXPECT_EQ(registries[1].listed(), expected);
  }
  // Both reported the same changes in the same order; those of each name are the acknowledged ones.
  if (registries[0].state_count() == 1 && registries[1].state_count() == 1) {
    for (WatchedRegistry& registry : registries) {
      const MonotonicTime give_up = rt::now() + 3s;  // This is before the leases end.
      while (registry.history() != acknowledged && rt::now() < give_up)
        rt::sleep_until(rt::now() + 10ms);
      const History told = registry.history();
      for (const auto& [name, urls] : acknowledged)
        expect_same(name, told.contains(name) ? told.at(name) : std::vector<std::string>{}, urls);
    }
    EXPECT_EQ(registries[0].changes(), registries[1].changes());
  }
  std::printf(
      "%d rounds, %llu acknowledged changes, %llu renewals, %llu without an answer, %d lost, "
      "%d differing, %zu changes told in one order\n",
      round_count(), static_cast<unsigned long long>(changes),
      static_cast<unsigned long long>(renewals), static_cast<unsigned long long>(unknown), lost,
      differing, registries[0].changes().size());
  EXPECT_GT(changes, 0u);
}

names::Claim permanent(std::string_view name, std::string_view url = "rtpm://10.0.0.1:1/x") {
  names::Claim claim{name, url, "lab.Arm", {1, 1}};
  claim.is_permanent = true;
  return claim;
}

/// The first item of a watch at a registry.
std::optional<names::WatchItemT> first_item(rpc::Node& node, const std::string& url,
                                            std::uint64_t history, std::uint64_t after) {
  auto client = names::NamesClient::bind(node, url, {.deadline = 5s});
  if (!client) return std::nullopt;
  names::WatchRequestT request;
  request.history = history;
  request.after = after;
  auto stream = client->watch(request);
  if (!stream) return std::nullopt;
  const auto item = stream->next(rt::now() + 5s);
  if (!item || *item == nullptr) return std::nullopt;
  names::WatchItemT copy;
  (*item)->UnPackTo(&copy);
  return copy;
}

TEST(EtcdRegistries, ReplaceEachOtherAndReportThatEtcdIsGone) {
  if (const auto missing = EtcdCluster::missing()) GTEST_SKIP() << *missing;
  EtcdCluster cluster;
  ASSERT_GE(cluster.await_leader(), 0);
  WatchedRegistry first(cluster.url());
  WatchedRegistry second(cluster.url());
  second.watch();
  // One registry's changes reach the other under the same revision.
  const auto bound = first.directory().bind(permanent("lab/camera"));
  ASSERT_TRUE(bound) << bound.error().text();
  ASSERT_TRUE(test::await([&] { return second.told().contains("lab/camera"); }));
  EXPECT_EQ(second.directory().resolve("lab/camera")->revision, bound->revision);
  EXPECT_EQ(second.directory().bind(permanent("lab/camera/lens")).error().outcome,
            names::Outcome::kNotADirectory);
  // Clients that know both registries continue at the other one.
  const std::string both = first.url() + "," + second.url();
  rpc::Node client{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  std::vector<std::string> reports;
  const auto registration = names::Registration::create(
      client, both, "lab/screen", "rtpm://10.0.0.1:1/s", "lab.Screen",
      names::Registration::kDefaultLease,
      [&](std::string_view sentence) { reports.emplace_back(sentence); });
  ASSERT_TRUE(registration) << registration.error().text();
  std::atomic<int> arm_count = 0;
  const auto watch =
      names::NameWatch::start(client, both, {.directory = "lab/arm"},
                              {.on_change = [&](const names::NameChange&) { ++arm_count; }});
  ASSERT_TRUE(watch) << watch.error().text();
  // A watch resumes at the other registry, behind the revision of the first one.
  const auto state = first_item(first.node(), first.url(), 0, 0);
  ASSERT_TRUE(state);
  ASSERT_EQ(state->phase, names::WatchPhase::StateEnd);
  ASSERT_TRUE(first.directory().bind({"lab/arm", "rtpm://10.0.0.1:1/a", "lab.Arm", {5, 1}, 2s}));
  ASSERT_TRUE(test::await([&] { return second.told().contains("lab/arm"); }));
  first.kill();
  const auto resumed = first_item(second.node(), second.url(), state->history, state->revision);
  ASSERT_TRUE(resumed);
  EXPECT_EQ(resumed->phase, names::WatchPhase::Changes);
  ASSERT_EQ(resumed->changes.size(), 1u);
  EXPECT_EQ(resumed->changes[0]->entry->name, "lab/arm");
  // The owner of the leased name renews it at the other registry.
  for (int i = 0; i < 5; ++i) {
    const auto renewed = second.directory().renew("lab/arm", {5, 1}, 2s);
    ASSERT_TRUE(renewed) << renewed.error().text();
    rt::sleep_until(rt::now() + 500ms);
  }
  // Without a renewal, etcd ends the lease.
  EXPECT_TRUE(test::await([&] { return !second.told().contains("lab/arm"); }));
  EXPECT_TRUE(test::await([&] { return arm_count == 2; })) << "bound and gone, each told once";
  EXPECT_EQ((*watch)->state_count(), 1u) << "it resumed where it was";
  EXPECT_TRUE((*registration)->is_bound());
  EXPECT_EQ(reports, std::vector<std::string>{}) << "the name was never lost";
  // Changes were compacted before a registry saw them: it reads all names again.
  WatchedRegistry third(cluster.url());
  third.watch();
  third.freeze();
  for (int node = 0; node < EtcdCluster::kNodeCount; ++node)
    cluster.kill(node);
  for (int node = 0; node < EtcdCluster::kNodeCount; ++node)
    cluster.start(node);
  ASSERT_GE(cluster.await_leader(), 0);
  ASSERT_TRUE(second.directory(5s).bind(permanent("lab/late")));
  ASSERT_TRUE(second.directory(5s).unbind("lab/camera", {1, 1}));
  cluster.compact();
  third.thaw();
  const State left{{"lab/late", "rtpm://10.0.0.1:1/x"}, {"lab/screen", "rtpm://10.0.0.1:1/s"}};
  EXPECT_TRUE(test::await([&] { return third.listed() == left && third.told() == left; }));
  EXPECT_EQ(third.state_count(), 2u) << "what changed meanwhile was not known one by one";
  // Without etcd, reads continue, marked as stale; changes fail with a reason.
  for (int node = 0; node < EtcdCluster::kNodeCount; ++node)
    cluster.kill(node);
  ASSERT_TRUE(test::await([&] { return second.is_stale(); }));
  const auto stale = second.directory().resolve("lab/late");
  ASSERT_TRUE(stale);
  EXPECT_GT(stale->stale_for, Duration{0});
  const auto failed = second.directory().bind(permanent("lab/never"));
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().outcome, names::Outcome::kStoreUnreachable);
  for (const std::string_view word : {"10.99.0.1:2379", "10.99.0.3:2379", "Remedy"}) {
    EXPECT_NE(failed.error().text().find(word), std::string::npos) << failed.error().text();
  }
  const auto told = run_program("rtpm", {"--registry", second.url(), "list", "--json"});
  EXPECT_NE(told.errors.find("has had no word from its storage"), std::string::npos) << told.errors;
  EXPECT_NE(told.output.find("\"stale_s\""), std::string::npos) << told.output;
  for (int node = 0; node < EtcdCluster::kNodeCount; ++node)
    cluster.start(node);
  EXPECT_TRUE(test::await([&] { return second.listed() == left; })) << "it is up to date again";
  // The daemon's own behaviour with etcd.
  const auto dumped = run_program("rtpm-registryd", {"--store", cluster.url(), "--dump"});
  EXPECT_NE(dumped.output.find("\"lab/late\""), std::string::npos) << dumped.errors;
  expect_one_sentence(run_program("rtpm-registryd", {"--store", "etcd://10.99.0.77:1"}), 1,
                      {"10.99.0.77:1", "Remedy"});
  expect_one_sentence(run_program("rtpm-registryd", {"--store", "etcd://,"}), 1, {"host:port"});
}

}  // namespace
}  // namespace rtpm::system_test
