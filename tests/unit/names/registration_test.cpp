#include "rtpm/names/registration.hpp"

#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>
#include <vector>

#include "registry_fixture.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/text.hpp"

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
TEST(FullRegistry, LetsServersStartAndBindLater) {
  Limits limits;
  limits.owner_count_own_host_max = 1;
  ServedRegistry registry(limits);
  rpc::Node node;
  Directory directory(node, registry.url());
  ASSERT_TRUE(directory.bind({"lab/other", kStrangersUrl, kInterface, kStranger, 1h}));
  Reports reports;
  const auto registration = test::made(
      Registration::create(node, registry.url(), kName, kUrl, kInterface, 300ms, reports.taker()));
  EXPECT_FALSE(registration->is_bound());
  test::expect_text(reports.await(1).front(),
                    {"is not bound yet, retrying: ", "--servers-per-host-max"});
  ASSERT_TRUE(directory.unbind("lab/other", kStranger));
  test::expect_text(reports.await(2).back(), {"is bound at " + registry.url()});
  EXPECT_TRUE(registration->is_bound());
  EXPECT_EQ(directory.resolve(kName)->url, kUrl);
}

TEST_F(RegistrationTest, BindsForItsLifetime) {
  {
    const auto registration = test::made(create(1h));
    EXPECT_TRUE(registration->is_bound());
    const auto entry = directory_.resolve(kName);
    ASSERT_TRUE(entry) << entry.error().text();
    EXPECT_EQ(entry->url, kUrl);
    EXPECT_EQ(entry->interface, kInterface);
  }
  EXPECT_EQ(url_of(kName), "");
}

TEST_F(RegistrationTest, RenewsItsLease) {
  const auto registration = test::made(create(2s));
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

TEST_F(RegistrationTest, ReportsOnceThatNoRegistryAnswersAndOnceThatItIsBack) {
  const auto registration = test::made(create());
  registry_.stop();
  ASSERT_EQ(reports_.await(1).size(), 1U);
  EXPECT_FALSE(registration->is_bound());
  registry_.start();
  const std::vector<std::string> sentences = reports_.await(2);
  ASSERT_EQ(sentences.size(), 2U);
  test::expect_text(sentences[0],
                    {"the name 'lab/arm0' is lost", "no registry answers at " + registry_.url()});
  test::expect_text(sentences[1], {"the name 'lab/arm0' is bound again at " + registry_.url()});
  EXPECT_TRUE(registration->is_bound());
  EXPECT_EQ(url_of(kName), kUrl);
}

// A later bind that offered refused properties would lose the name.
TEST_F(RegistrationTest, KeepsItsNameAndPropertiesIfNewOnesAreRefused) {
  const std::vector<Property> accepted{{"is_free", true}};
  const auto registration =
      test::made(Registration::create(node_, registry_.url(), kName, kUrl, kInterface, 300ms,
                                      reports_.taker(), Takeover::kRefused, accepted));
  std::vector<Property> large;
  for (std::size_t i = 0; i < kPropertyCountMax; ++i)
    large.push_back({"note" + std::to_string(i), std::string(kPropertyTextSizeMax, 'x')});
  EXPECT_FALSE(registration->set_properties({{"is free", false}})) << "malformed";
  EXPECT_FALSE(registration->set_properties(large)) << "beyond a limit";
  registry_.stop();
  ASSERT_EQ(reports_.await(1).size(), 1U);
  EXPECT_FALSE(registration->set_properties({{"is free", false}})) << "without a registry";
  registry_.start();
  test::expect_text(reports_.await(2).back(), {"the name 'lab/arm0' is bound again"});
  EXPECT_EQ(directory_.describe(kName)->properties, accepted);
}

TEST_F(RegistrationTest, SetsNewPropertiesWithTheNextBindIfNoRegistryAnswers) {
  const auto registration = test::made(create());
  registry_.stop();
  ASSERT_EQ(reports_.await(1).size(), 1U);
  const std::vector<Property> later{{"is_free", false}};
  EXPECT_FALSE(registration->set_properties(later));
  registry_.start();
  test::expect_text(reports_.await(2).back(), {"the name 'lab/arm0' is bound again"});
  EXPECT_EQ(directory_.describe(kName)->properties, later);
}

TEST_F(RegistrationTest, ReportsALossOnceAndTakesTheNameBackWhenItIsFree) {
  const auto registration = test::made(create());
  ASSERT_TRUE(directory_.rebind({.name = kName,
                                 .url = kStrangersUrl,
                                 .interface = kInterface,
                                 .owner = kStranger,
                                 .lease = 1s,
                                 .allows_takeover = true}));
  const std::vector<std::string> lost = reports_.await(1);
  ASSERT_EQ(lost.size(), 1U);
  test::expect_text(lost[0], {"held by another server", kStrangersUrl});
  // Meanwhile the registration retries several times.
  const std::vector<std::string> back = reports_.await(2);
  ASSERT_EQ(back.size(), 2U);
  test::expect_text(back[1], {"is bound again"});
  EXPECT_EQ(url_of(kName), kUrl);
}

TEST_F(RegistrationTest, DoesNotUnbindANameThatAnotherOwnerTook) {
  {
    const auto registration = test::made(create(1h));
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
  const auto registration = test::made(create());
  EXPECT_EQ(directory_.renew(kName, earlier, 1h).error().outcome, Outcome::kStaleEpoch);
}

TEST_F(RegistrationTest, WaitsForTheLeaseOfADeadHolder) {
  ASSERT_TRUE(directory_.bind({kName, kStrangersUrl, kInterface, kStranger, 200ms}));
  const auto registration = test::made(create());
  EXPECT_EQ(url_of(kName), kUrl);
}

TEST_F(RegistrationTest, TakesANameFromALivingServerIfAllowed) {
  const auto holder = test::made(Registration::create(node_, registry_.url(), kName, kStrangersUrl,
                                                      kInterface, 1s, reports_.taker()));
  const auto taker = test::made(Registration::create(node_, registry_.url(), kName, kUrl,
                                                     kInterface, 1s, {}, Takeover::kAllowed));
  EXPECT_EQ(url_of(kName), kUrl);
  // The former holder does not fight back.
  ASSERT_EQ(reports_.await(1).size(), 1U);
  EXPECT_TRUE(taker->is_bound());
  EXPECT_EQ(url_of(kName), kUrl);
}

TEST_F(RegistrationTest, ReportsTheLivingHolderOfTheName) {
  const auto holder = test::made(Registration::create(node_, registry_.url(), kName, kStrangersUrl,
                                                      kInterface, 600ms, reports_.taker()));
  const auto registration = create();
  ASSERT_FALSE(registration);
  test::expect_text(registration.error().text(),
                    {"'lab/arm0' is held by another server", kStrangersUrl});
}

TEST_F(RegistrationTest, ReportsInvalidArguments) {
  const auto bad_name = create(300ms, "lab/arm 0");
  ASSERT_FALSE(bad_name);
  test::expect_text(bad_name.error().text(), {"component 2 of the name 'lab/arm 0'"});
  EXPECT_FALSE(create(1ms));
  const auto nowhere = Registration::create(node_, unserved_url(), kName, kUrl, kInterface);
  ASSERT_FALSE(nowhere);
  test::expect_text(nowhere.error().text(), {"start rtpm-registryd, or give --registry URL"});
}

// The registry grants a shorter lease at first; a registration that renewed by its requested lease
// would lose the name.
TEST(Registration, RenewsByTheGrantedLease) {
  ServedRegistry registry({.first_lease_max = 300ms});
  rpc::Node node;
  const auto registration =
      test::made(Registration::create(node, registry.url(), kName, kUrl, kInterface, 1h));
  // Only a renewal of a name that was held for some time gets the whole lease.
  EXPECT_TRUE(test::await([&] {
    const auto entry = Directory(node, registry.url()).resolve(kName);
    return entry && entry->lease_left > 1min;
  }));
}

}  // namespace
}  // namespace rtpm::names
