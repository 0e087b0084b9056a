#include "rtpm/names/watch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "names.rtpm.hpp"
#include "registry_fixture.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "store/change_log.hpp"
#include "store/store.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

constexpr Owner kArm{.id = 1, .epoch = 1};
constexpr Owner kStranger{.id = 2, .epoch = 1};
constexpr const char* kUrl = "rtpm://127.0.0.1:4711/object";
constexpr const char* kOtherUrl = "rtpm://127.0.0.1:4712/object";

Claim claim(std::string_view name, std::string_view url = kUrl,
            std::span<const Property> properties = {}) {
  Claim claimed{name, url, "lab.Arm", kArm, 10s};
  claimed.properties = properties;
  return claimed;
}

/// The reports of a watch.
class Reports {
 public:
  WatchHandlers handlers() {
    return {.on_change =
                [this](const NameChange& change) {
                  constexpr const char* kWords[] = {"bound ", "changed ", "gone "};
                  add(kWords[static_cast<int>(change.kind)] + change.entry.name);
                },
            .on_state = [this] { add("state"); },
            .on_notice =
                [this](std::string_view sentence) {
                  const std::lock_guard lock(mutex_);
                  notices_.emplace_back(sentence);
                }};
  }
  [[nodiscard]] std::vector<std::string> all() const {
    const std::lock_guard lock(mutex_);
    return all_;
  }
  [[nodiscard]] std::size_t count() const { return all().size(); }
  [[nodiscard]] std::vector<std::string> notices() const {
    const std::lock_guard lock(mutex_);
    return notices_;
  }

 private:
  void add(std::string text) {
    const std::lock_guard lock(mutex_);
    all_.push_back(std::move(text));
  }
  mutable std::mutex mutex_;
  std::vector<std::string> all_{};
  std::vector<std::string> notices_{};
};

using Texts = std::vector<std::string>;

class Watch : public testing::Test {
 protected:
  void bind(std::string_view name, std::string_view url = kUrl,
            std::vector<Property> properties = {}) {
    const auto bound = directory_.bind(claim(name, url, properties));
    EXPECT_TRUE(bound) << bound.error().text();
  }
  void unbind(std::string_view name) { EXPECT_TRUE(directory_.unbind(name, kArm)); }
  std::unique_ptr<NameWatch> start(Reports& reports, WatchConfig config = {}) {
    auto watch = NameWatch::start(node_, registry_.url(), std::move(config), reports.handlers());
    EXPECT_TRUE(watch) << watch.error().text();
    return watch ? std::move(*watch) : nullptr;
  }

  // The history outlasts a pause of the thread that watches, on a busy machine.
  ServedRegistry registry_{{.watch_backlog_max = 100, .history_count_max = 3000}};
  rpc::Node node_{{.wait = {.strategy = rt::WaitStrategy::kBlock}, .channel_count_max = 128}};
  Directory directory_{node_, registry_.url()};
};

TEST_F(Watch, ReportsTheStateAndThenEveryChangeInOrder) {
  bind("lab/arm0");
  bind("lab/arm1");
  bind("lab-2/arm0");
  Reports reports;
  const auto watch = start(reports, {.directory = "lab"});
  ASSERT_TRUE(watch);
  ASSERT_TRUE(test::await([&] { return reports.count() == 3; }));
  bind("lab/arm2");
  bind("lab/arm0", kOtherUrl);
  bind("hall/arm0");
  bind("lab/arm0", kOtherUrl);  // Changes only the lease.
  unbind("lab/arm1");
  bind("lab/arm1");
  ASSERT_TRUE(test::await([&] { return reports.count() == 7; }));
  EXPECT_EQ(reports.all(), (Texts{"bound lab/arm0", "bound lab/arm1", "state", "bound lab/arm2",
                                  "changed lab/arm0", "gone lab/arm1", "bound lab/arm1"}));
  EXPECT_EQ(watch->state_count(), 1u);
}

TEST_F(Watch, ReportsANameThatNoLongerMatchesAsGone) {
  bind("lab/arm0", kUrl, {{"is_free", true}});
  bind("lab/arm1", kUrl, {{"is_free", false}});
  Reports reports;
  const auto watch = start(reports, {.interface = "lab.Arm", .predicate = "is_free"});
  ASSERT_TRUE(watch);
  ASSERT_TRUE(test::await([&] { return reports.count() == 2; }));
  bind("lab/arm1", kUrl, {{"is_free", true}});
  bind("lab/arm0", kUrl, {{"is_free", true}, {"more", true}});
  bind("lab/arm0", kUrl, {{"is_free", false}});
  bind("lab/arm0", kUrl, {{"is_free", false}, {"more", true}});
  unbind("lab/arm0");
  unbind("lab/arm1");
  ASSERT_TRUE(test::await([&] { return reports.count() == 6; }));
  EXPECT_EQ(reports.all(), (Texts{"bound lab/arm0", "state", "bound lab/arm1", "changed lab/arm0",
                                  "gone lab/arm0", "gone lab/arm1"}));
}

TEST_F(Watch, ReportsAnExpiredLeaseWithoutAnyOperation) {
  Claim brief = claim("lab/arm0");
  brief.lease = 100ms;
  Reports reports;
  const auto watch = start(reports);
  ASSERT_TRUE(watch);
  ASSERT_TRUE(directory_.bind(brief));
  ASSERT_TRUE(test::await([&] { return reports.count() == 3; }));
  EXPECT_EQ(reports.all(), (Texts{"state", "bound lab/arm0", "gone lab/arm0"}));
}

TEST_F(Watch, RefusesABadPredicateAndABadDirectory) {
  const auto refused = NameWatch::start(node_, registry_.url(), {.predicate = "is_free ="}, {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().outcome, Outcome::kBadPredicate);
  ASSERT_TRUE(refused.error().text_error);
  EXPECT_EQ(refused.error().text_error->offset, 8u);
  const auto bad = NameWatch::start(node_, registry_.url(), {.directory = "lab//"}, {});
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().outcome, Outcome::kBadName);
}

TEST_F(Watch, ComparesWithTheFullStateAfterARestartOfTheRegistry) {
  bind("lab/arm0");
  bind("lab/arm1");
  Reports reports;
  const auto watch = start(reports);
  ASSERT_TRUE(watch);
  ASSERT_TRUE(test::await([&] { return reports.count() == 3; }));
  registry_.stop();
  ASSERT_TRUE(test::await([&] { return !watch->is_connected(); }));
  registry_.start();
  ASSERT_TRUE(test::await([&] { return watch->state_count() == 2; }));
  bind("lab/arm2");
  ASSERT_TRUE(test::await([&] { return reports.count() == 7; }));
  const Texts all = reports.all();
  EXPECT_EQ(Texts(all.begin() + 3, all.end()),
            (Texts{"gone lab/arm0", "gone lab/arm1", "state", "bound lab/arm2"}));
  EXPECT_EQ(reports.notices().size(), 2u);
}

TEST_F(Watch, ReachesAHundredWatchers) {
  std::vector<std::unique_ptr<Reports>> reports;
  std::vector<std::unique_ptr<NameWatch>> watches;
  for (int i = 0; i < 100; ++i) {
    reports.push_back(std::make_unique<Reports>());
    watches.push_back(start(*reports.back()));
    ASSERT_TRUE(watches.back()) << i;
  }
  bind("lab/arm0");
  EXPECT_TRUE(test::await([&] {
    return std::ranges::all_of(reports, [](const auto& each) {
      return each->all() == Texts{"state", "bound lab/arm0"};
    });
  }));
}

// ---- the stream itself ---------------------------------------------------------------------

class WatchStream : public Watch {
 protected:
  using Stream = rpc::TableStream<WatchItem>;
  /// Opens a stream that resumes after the given revision of the given history.
  Stream open(std::uint64_t history, std::uint64_t after) {
    WatchRequestT request;
    request.history = history;
    request.after = after;
    auto stream = client_.watch(request, {.window = 2});
    EXPECT_TRUE(stream);
    return std::move(*stream);
  }
  static const WatchItem* next(Stream& stream) {
    const auto item = stream.next(rt::now() + 10s);
    EXPECT_TRUE(item) << rpc::to_string(item.error());
    return item ? *item : nullptr;
  }

  NamesClient client_ = NamesClient::bind(node_, registry_.url()).value();
};

TEST_F(WatchStream, ResumesAfterARevisionOrSendsTheWholeState) {
  bind("lab/arm0");
  std::uint64_t history = 0;
  std::uint64_t after = 0;
  {
    Stream stream = open(0, 0);
    const WatchItem* const state = next(stream);
    ASSERT_EQ(state->phase(), WatchPhase::StateEnd);
    ASSERT_EQ(state->changes()->size(), 1u);
    history = state->history();
    after = state->revision();
  }
  bind("lab/arm1");
  unbind("lab/arm0");
  Stream resumed = open(history, after);
  const WatchItem* const changes = next(resumed);
  ASSERT_EQ(changes->phase(), WatchPhase::Changes);
  ASSERT_EQ(changes->changes()->size(), 2u);
  EXPECT_EQ(changes->changes()->Get(0)->kind(), ChangeKind::Bound);
  EXPECT_EQ(changes->changes()->Get(1)->kind(), ChangeKind::Gone);
  EXPECT_EQ(changes->revision(), after + 2);
  // For another history, or a future revision, the stream sends the whole state.
  Stream foreign = open(history + 1, after);
  EXPECT_EQ(next(foreign)->phase(), WatchPhase::StateEnd);
  Stream early = open(history, after + 1000);
  EXPECT_EQ(next(early)->phase(), WatchPhase::StateEnd);
  for (int i = 0; i < 2000; ++i) {
    bind("lab/arm1", kOtherUrl);
    bind("lab/arm1", kUrl);
  }
  Stream late = open(history, after);
  EXPECT_EQ(next(late)->phase(), WatchPhase::StateEnd) << "the history has 3000 changes";
}

TEST_F(WatchStream, CutsASlowWatcherOffAndLetsItResume) {
  Stream slow = open(0, 0);
  const std::uint64_t history = next(slow)->history();
  bind("lab/arm0");
  const auto cut_off_count = [&] { return (*client_.report())->cut_off_watch_count(); };
  std::uint64_t changes_made = 1;
  while (cut_off_count() == 0 && changes_made < 100'000) {
    bind("lab/arm0", changes_made % 2 == 0 ? kUrl : kOtherUrl);
    ++changes_made;
  }
  ASSERT_EQ(cut_off_count(), 1u);
  std::uint64_t revision = 0;
  std::uint64_t changes_seen = 0;
  for (;;) {
    const WatchItem* const item = next(slow);
    ASSERT_NE(item, nullptr) << "the end comes without a cut-off";
    if (item->changes() != nullptr) changes_seen += item->changes()->size();
    revision = item->revision();
    if (item->phase() == WatchPhase::CutOff) break;
  }
  EXPECT_LT(changes_seen, changes_made);
  Stream resumed = open(history, revision);
  while (changes_seen < changes_made) {
    const WatchItem* const item = next(resumed);
    ASSERT_EQ(item->phase(), WatchPhase::Changes) << "the history still has the next change";
    changes_seen += item->changes()->size();
  }
  EXPECT_EQ(changes_seen, changes_made) << "none twice, none lost";
}

TEST(ChangeLog, StaysBoundedOverAMillionChanges) {
  Store store({.history_count_max = 1000, .history_byte_max = 100'000'000});
  for (int i = 0; i < 1'000'000; ++i) {
    ASSERT_TRUE(store.bind(claim("lab/arm0", i % 2 == 0 ? kUrl : kOtherUrl), MonotonicTime{1s}));
  }
  const std::uint64_t newest = store.log().revision();
  EXPECT_EQ(newest, 1'000'000u);
  EXPECT_TRUE(store.log().reaches(newest - 1000));
  EXPECT_FALSE(store.log().reaches(newest - 1001));
  EXPECT_FALSE(store.log().reaches(newest + 1));
  EXPECT_EQ(store.log().count_after(newest - 10), 10u);
  EXPECT_EQ(store.log().after(newest), nullptr);
}

TEST(ChangeLog, IsBoundedByBytes) {
  Store store({.history_byte_max = 50'000});
  for (int i = 0; i < 1000; ++i) {
    const std::vector<Property> properties{{"i", i + 0.5}, {"text", std::string(200, 'x')}};
    ASSERT_TRUE(store.bind(claim("lab/arm0", kUrl, properties), MonotonicTime{1s}));
  }
  EXPECT_FALSE(store.log().reaches(store.log().revision() - 200));
  EXPECT_TRUE(store.log().reaches(store.log().revision() - 20));
}

// ---- bindings that follow a name -----------------------------------------------------------

TEST_F(Watch, RebindsToAMovedServerBeforeACallFails) {
  ServedRegistry first;
  ServedRegistry second;
  RegistryResolver resolver(node_, registry_.url());
  node_.use(resolver);
  const std::string here_url = first.url();
  Claim here = claim("lab/names", here_url);
  here.interface = "rtpm.names.Names";
  ASSERT_TRUE(directory_.bind(here));
  auto client = NamesClient::bind(node_, "lab/names");
  ASSERT_TRUE(client) << client.error().text();
  EXPECT_EQ(client->binding().url(), here_url);
  // There is no call, so only the registry can report the move.
  const std::string there_url = second.url();
  Claim there = here;
  there.url = there_url;
  there.owner = kStranger;
  there.allows_takeover = true;
  ASSERT_TRUE(directory_.rebind(there));
  EXPECT_TRUE(test::await([&] { return client->binding().url() == there_url; }));
  EXPECT_EQ(resolver.move_count(), 1u);
  EXPECT_TRUE(client->report());
}

TEST(Watches, AreLimitedForTheOwnHost) {
  Limits limits;
  limits.watch_count_max = 4;
  ServedRegistry registry(limits);
  rpc::Node node;
  std::vector<std::unique_ptr<NameWatch>> watches;
  for (int i = 0; i < 3; ++i) {
    auto watch = NameWatch::start(node, registry.url(), {}, {});
    ASSERT_TRUE(watch) << watch.error().text();
    watches.push_back(std::move(*watch));
  }
  const auto refused = NameWatch::start(node, registry.url(), {}, {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().outcome, Outcome::kTooManyWatches);
}

}  // namespace
}  // namespace rtpm::names
