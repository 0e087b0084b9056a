#include "rtpm/names/registration.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <vector>

#include "names.rtpm.hpp"
#include "registry_fixture.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

/// How long a test waits for an expected event; only a failing test waits that long.
constexpr Duration kPatience = 20s;

constexpr const char* kName = "lab/arm0";
constexpr const char* kUrl = "rtpm://127.0.0.1:4711/lab/arm0";
constexpr const char* kInterface = "lab.Arm";
constexpr Owner kStranger{.id = 7, .epoch = 1};
constexpr const char* kStrangersUrl = "rtpm://127.0.0.1:4712/lab/arm0";

/// The messages of a registration.
class Reports {
 public:
  Registration::Report taker() {
    return [this](std::string_view sentence) {
      const std::lock_guard lock(mutex_);
      sentences_.emplace_back(sentence);
      changed_.notify_all();
    };
  }
  /// Waits for `count` messages; returns all so far.
  std::vector<std::string> await(std::size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kPatience, [&] { return sentences_.size() >= count; });
    return sentences_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> sentences_;
};

void expect_part(const std::string& text, std::string_view part) {
  EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in: " << text;
}

class RegistrationTest : public testing::Test {
 protected:
  expected<std::unique_ptr<Registration>, SetupError> create(Duration lease = 300ms,
                                                             std::string name = kName) {
    return Registration::create(node_, registry_.url(), std::move(name), kUrl, kInterface, lease,
                                reports_.taker());
  }
  [[nodiscard]] std::string url_of(std::string_view name) {
    const auto entry = directory_.resolve(name);
    return entry ? entry->url : "";
  }

  ServedRegistry registry_;
  rpc::Node node_;
  Directory directory_{node_, registry_.url()};
  Reports reports_;
};

// Other programs may have filled the registry: the server serves, and its name follows later.
TEST(FullRegistry, KeepsNoServerFromStarting) {
  Limits limits;
  limits.owner_count_own_host_max = 1;
  ServedRegistry registry(limits);
  rpc::Node node;
  Directory directory(node, registry.url());
  ASSERT_TRUE(directory.bind({"lab/other", kStrangersUrl, kInterface, kStranger, 1h}));
  Reports reports;
  const auto registration =
      Registration::create(node, registry.url(), kName, kUrl, kInterface, 300ms, reports.taker());
  ASSERT_TRUE(registration) << registration.error().text();
  EXPECT_FALSE((*registration)->is_bound());
  expect_part(reports.await(1).front(), "is not bound yet, retrying: ");
  expect_part(reports.await(1).front(), "--servers-per-host-max");
  ASSERT_TRUE(directory.unbind("lab/other", kStranger));
  expect_part(reports.await(2).back(), "is bound at " + registry.url());
  EXPECT_TRUE((*registration)->is_bound());
  EXPECT_EQ(directory.resolve(kName)->url, kUrl);
}

TEST_F(RegistrationTest, BindsForItsLifeAndNoLonger) {
  {
    const auto registration = create(1h);
    ASSERT_TRUE(registration) << registration.error().text();
    EXPECT_TRUE((*registration)->is_bound());
    const auto entry = directory_.resolve(kName);
    ASSERT_TRUE(entry) << entry.error().text();
    EXPECT_EQ(entry->url, kUrl);
    EXPECT_EQ(entry->interface, kInterface);
  }
  EXPECT_EQ(url_of(kName), "");
}

TEST_F(RegistrationTest, RenewsItsLease) {
  const auto registration = create(2s);
  ASSERT_TRUE(registration) << registration.error().text();
  Duration least = 2s;
  // Only a renewal extends the remaining time.
  EXPECT_TRUE(test::await([&] {
    const auto entry = directory_.resolve(kName);
    if (!entry) return false;
    if (entry->lease_left > least + 200ms) return true;
    least = std::min(least, entry->lease_left);
    return false;
  }));
}

TEST_F(RegistrationTest, BindsAgainAfterTheRegistryRestarted) {
  const auto registration = create();
  ASSERT_TRUE(registration) << registration.error().text();
  registry_.stop();
  registry_.start();
  EXPECT_TRUE(test::await([&] { return url_of(kName) == kUrl; }));
  EXPECT_TRUE(test::await([&] { return (*registration)->is_bound(); }));
}

TEST_F(RegistrationTest, ReportsOnceThatNoRegistryAnswersAndOnceThatItIsBack) {
  const auto registration = create();
  ASSERT_TRUE(registration) << registration.error().text();
  registry_.stop();
  ASSERT_EQ(reports_.await(1).size(), 1U);
  EXPECT_FALSE((*registration)->is_bound());
  registry_.start();
  const std::vector<std::string> sentences = reports_.await(2);
  ASSERT_EQ(sentences.size(), 2U);
  expect_part(sentences[0], "the name 'lab/arm0' is lost");
  expect_part(sentences[0], "no registry answers at " + registry_.url());
  expect_part(sentences[1], "the name 'lab/arm0' is bound again at " + registry_.url());
  EXPECT_TRUE((*registration)->is_bound());
  EXPECT_EQ(url_of(kName), kUrl);
}

TEST_F(RegistrationTest, ReportsWhoTookTheNameAndTakesItBackWhenItIsFree) {
  const auto registration = create();
  ASSERT_TRUE(registration) << registration.error().text();
  ASSERT_TRUE(directory_.rebind({.name = kName,
                                 .url = kStrangersUrl,
                                 .interface = kInterface,
                                 .owner = kStranger,
                                 .lease = 1h,
                                 .allows_takeover = true}));
  const std::vector<std::string> lost = reports_.await(1);
  ASSERT_EQ(lost.size(), 1U);
  expect_part(lost[0], "held by another server");
  expect_part(lost[0], kStrangersUrl);
  EXPECT_EQ(url_of(kName), kStrangersUrl);
  ASSERT_TRUE(directory_.unbind(kName, kStranger));
  EXPECT_EQ(reports_.await(2).size(), 2U);
  EXPECT_EQ(url_of(kName), kUrl);
}

TEST_F(RegistrationTest, LeavesANameThatAnotherOwnerTookAlone) {
  {
    const auto registration = create(1h);
    ASSERT_TRUE(registration) << registration.error().text();
    ASSERT_TRUE(directory_.rebind({.name = kName,
                                   .url = kStrangersUrl,
                                   .interface = kInterface,
                                   .owner = kStranger,
                                   .lease = 1h,
                                   .allows_takeover = true}));
  }
  EXPECT_EQ(url_of(kName), kStrangersUrl);
}

TEST_F(RegistrationTest, TakesOverFromAnEarlierStartOfTheSameServer) {
  Owner earlier = owner_of(kUrl);
  --earlier.epoch;
  ASSERT_TRUE(directory_.bind({kName, kUrl, kInterface, earlier, 1h}));
  const auto registration = create();
  ASSERT_TRUE(registration) << registration.error().text();
  EXPECT_EQ(directory_.renew(kName, earlier, 1h).error().outcome, Outcome::kStaleEpoch);
}

TEST_F(RegistrationTest, WaitsForTheLeaseOfADeadHolder) {
  ASSERT_TRUE(directory_.bind({kName, kStrangersUrl, kInterface, kStranger, 200ms}));
  const auto registration = create();
  ASSERT_TRUE(registration) << registration.error().text();
  EXPECT_EQ(url_of(kName), kUrl);
}

TEST_F(RegistrationTest, TakesANameFromALivingServerOnlyWhereThatIsAllowed) {
  const auto holder = Registration::create(node_, registry_.url(), kName, kStrangersUrl, kInterface,
                                           1s, reports_.taker());
  ASSERT_TRUE(holder) << holder.error().text();
  const auto taker = Registration::create(node_, registry_.url(), kName, kUrl, kInterface, 1s, {},
                                          Takeover::kAllowed);
  ASSERT_TRUE(taker) << taker.error().text();
  EXPECT_EQ(url_of(kName), kUrl);
  // The former holder does not fight back.
  ASSERT_EQ(reports_.await(1).size(), 1U);
  EXPECT_TRUE((*taker)->is_bound());
  EXPECT_EQ(url_of(kName), kUrl);
}

TEST_F(RegistrationTest, SaysWhoHoldsTheNameIfThatServerLives) {
  const auto holder = Registration::create(node_, registry_.url(), kName, kStrangersUrl, kInterface,
                                           600ms, reports_.taker());
  ASSERT_TRUE(holder) << holder.error().text();
  const auto registration = create();
  ASSERT_FALSE(registration);
  expect_part(registration.error().text(), "'lab/arm0' is held by another server");
  expect_part(registration.error().text(), kStrangersUrl);
}

TEST_F(RegistrationTest, SaysWhatIsWrongWithWhatItWasGiven) {
  const auto bad_name = create(300ms, "lab/arm 0");
  ASSERT_FALSE(bad_name);
  expect_part(bad_name.error().text(), "component 2 of the name 'lab/arm 0'");
  EXPECT_FALSE(create(1ms));
  const auto nowhere = Registration::create(node_, unserved_url(), kName, kUrl, kInterface);
  ASSERT_FALSE(nowhere);
  expect_part(nowhere.error().text(), "start rtpm-registryd, or give --registry URL");
}

/// A registry with scripted answers.
class WilfulRegistry final : public NamesServant {
 public:
  rpc::Result<void> offer(const OfferRequest&, rpc::ReplyBuilder<BindReply>& reply,
                          const rpc::CallContext&) override {
    const Answer answer{is_refusing ? OutcomeCode::AlreadyBound : OutcomeCode::Done, 0};
    reply.finish(CreateBindReply(reply.builder(), &answer, 0, 0, 0, granted_ns));
    return {};
  }
  rpc::Result<void> bind(const BindRequest&, rpc::ReplyBuilder<BindReply>&,
                         const rpc::CallContext&) override {
    return unexpected{rpc::Refusal::kFailed};
  }
  rpc::Result<void> describe(const ResolveRequest&, rpc::ReplyBuilder<ResolveReply>&,
                             const rpc::CallContext&) override {
    return unexpected{rpc::Refusal::kFailed};
  }
  rpc::Result<void> find(const FindRequest&, rpc::ReplyBuilder<FindReply>&,
                         const rpc::CallContext&) override {
    return unexpected{rpc::Refusal::kFailed};
  }
  void watch(const WatchRequest&, rpc::TableWriter<WatchItem> items,
             const rpc::CallContext&) override {
    items.finish();
  }
  rpc::Result<void> rebind(const BindRequest&, rpc::ReplyBuilder<BindReply>&,
                           const rpc::CallContext&) override {
    return unexpected{rpc::Refusal::kFailed};
  }
  rpc::Result<Answer> renew(const RenewRequest&, const rpc::CallContext&) override {
    ++renewal_count;
    return Answer{is_refusing ? OutcomeCode::NotOwner : OutcomeCode::Done, 0};
  }
  rpc::Result<void> resolve(const ResolveRequest&, rpc::ReplyBuilder<ResolveReply>&,
                            const rpc::CallContext&) override {
    return unexpected{rpc::Refusal::kFailed};
  }
  rpc::Result<void> list(const ListRequest&, rpc::ReplyBuilder<ListReply>&,
                         const rpc::CallContext&) override {
    return unexpected{rpc::Refusal::kFailed};
  }
  rpc::Result<void> lapsed(const ListRequest&, rpc::ReplyBuilder<LapsedReply>&,
                           const rpc::CallContext&) override {
    return unexpected{rpc::Refusal::kFailed};
  }
  rpc::Result<Answer> unbind(const UnbindRequest&, const rpc::CallContext&) override {
    return Answer{OutcomeCode::Done, 0};
  }
  rpc::Result<void> report(rpc::ReplyBuilder<Report>&, const rpc::CallContext&) override {
    return unexpected{rpc::Refusal::kFailed};
  }

  std::atomic<bool> is_refusing{false};
  std::atomic<int> renewal_count{0};
  std::atomic<std::uint64_t> granted_ns{100'000'000};
};

// The registry grants a shorter lease at first; a registration that renewed by its requested lease
// would lose the name.
TEST(Registration, RenewsByTheLeaseThatItWasGranted) {
  WilfulRegistry servant;
  ServedRegistry registry(servant);
  rpc::Node node;
  const auto registration = Registration::create(node, registry.url(), kName, kUrl, kInterface, 1h);
  ASSERT_TRUE(registration) << registration.error().text();
  EXPECT_TRUE(test::await([&] { return servant.renewal_count >= 2; }));
}

TEST(Registration, ReportsLossAndReturnOnceHoweverOftenItRenews) {
  WilfulRegistry servant;
  ServedRegistry registry(servant);
  const auto await_renewals = [&](int count) {
    return test::await(
        [&, end = servant.renewal_count + count] { return servant.renewal_count >= end; });
  };
  rpc::Node node;
  Reports reports;
  const auto registration =
      Registration::create(node, registry.url(), kName, kUrl, kInterface, 100ms, reports.taker());
  ASSERT_TRUE(registration) << registration.error().text();
  ASSERT_TRUE(await_renewals(2));
  EXPECT_EQ(reports.await(0).size(), 0U);
  servant.is_refusing = true;
  EXPECT_EQ(reports.await(1).size(), 1U);
  ASSERT_TRUE(await_renewals(4));
  EXPECT_EQ(reports.await(1).size(), 1U);
  servant.is_refusing = false;
  EXPECT_EQ(reports.await(2).size(), 2U);
  ASSERT_TRUE(await_renewals(4));
  EXPECT_EQ(reports.await(2).size(), 2U);
}

}  // namespace
}  // namespace rtpm::names
