// Names without a registry: the folder of sockets leads to them on this host.
#include <gtest/gtest.h>
#include <sched.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "answer_limit.hpp"
#include "finding/name_views.hpp"
#include "registry_fixture.hpp"
#include "rtpm/discovery/announcement.hpp"
#include "rtpm/discovery/datagram.hpp"
#include "rtpm/discovery/finder.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/names/watch.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "rtpm/test/text.hpp"
#include "rtpm/transport/lan_socket.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

constexpr const char* kUrl = "rtpm://127.0.0.1:4711/lab/arm0";
constexpr const char* kOtherUrl = "rtpm://127.0.0.1:4712/lab/arm0";
constexpr const char* kInterface = "lab.Arm";

/// The messages of registrations and watches.
class Sentences {
 public:
  [[nodiscard]] std::function<void(std::string_view)> taker() {
    return [this](std::string_view sentence) {
      const std::lock_guard lock(mutex_);
      all_.emplace_back(sentence);
    };
  }
  [[nodiscard]] bool have(std::string_view part) {
    const std::lock_guard lock(mutex_);
    return std::ranges::any_of(all_, [&](const std::string& sentence) {
      return sentence.find(part) != std::string::npos;
    });
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> all_;
};

/// A folder that only this test's programs use, so that no registry at the default port is asked.
class Discovery : public testing::Test {
 protected:
  Discovery() { setenv("RTPM_RUNTIME_FOLDER", folder_.c_str(), 1); }
  ~Discovery() override { unsetenv("RTPM_RUNTIME_FOLDER"); }

  [[nodiscard]] expected<std::unique_ptr<Registration>, SetupError> create(
      const std::string& name, const std::string& url, std::vector<Property> properties = {}) {
    return Registration::create(node_, std::string(kThisHost), name, url, kInterface, 300ms,
                                said_.taker(), Takeover::kRefused, std::move(properties));
  }
  /// Announces the served registry.
  [[nodiscard]] std::unique_ptr<discovery::Announcement> announce(ServedRegistry& registry,
                                                                  bool is_registry = true) {
    auto announced =
        discovery::Announcement::create({}, {is_registry, {"127.0.0.1"}, registry.server().port()});
    EXPECT_TRUE(announced) << announced.error().text();
    return std::move(*announced);
  }
  [[nodiscard]] std::string url_of(const std::string& name) {
    const auto entry = directory_.resolve(name);
    return entry ? entry->url : "";
  }

  const test::TemporaryFolder own_folder_;
  const std::string folder_ = own_folder_.path();
  rpc::Node node_;
  Directory directory_{node_};
  Sentences said_;
};

TEST_F(Discovery, ReportsThatNoServerRuns) {
  const auto listed = directory_.list();
  ASSERT_FALSE(listed);
  test::expect_text(listed.error().text(), {"no registry runs, and no server that serves its names",
                                            "start rtpm-registryd or a server"});
}

TEST_F(Discovery, FindsNamesThatAProgramServesItself) {
  const auto registration =
      test::made(create("lab/arm0", kUrl, {{"force_newton_max", 3.5, "newton"}}));
  EXPECT_TRUE(registration->is_bound());
  EXPECT_EQ(url_of("lab/arm0"), kUrl);
  EXPECT_EQ(directory_.url_of("lab/arm0/config").value_or(""), std::string(kUrl) + "/config");
  EXPECT_EQ(directory_.list()->size(), 1U);
  EXPECT_EQ(directory_.describe("lab/arm0")->properties.size(), 1U);
  EXPECT_EQ(directory_.find({.predicate = "force_newton_max > 3"})->entries.size(), 1U);
  EXPECT_EQ(directory_.find({.predicate = "force_newton_max > 4"})->entries.size(), 0U);
  EXPECT_EQ(directory_.resolve("lab/arm1").error().outcome, Outcome::kNotFound);
  ASSERT_TRUE(registration->set_properties({{"force_newton_max", 5.0, "newton"}}));
  EXPECT_EQ(directory_.find({.predicate = "force_newton_max > 4"})->entries.size(), 1U);
}

TEST_F(Discovery, RemovesItsSocketWithTheLastRegistration) {
  {
    const auto registration = test::made(create("lab/arm0", kUrl));
    EXPECT_EQ(url_of("lab/arm0"), kUrl);
  }
  EXPECT_FALSE(directory_.list());
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

// Other programs may read the program's names, but not change them.
TEST_F(Discovery, ServesNamesOfItsOwnProgramOnly) {
  const auto registration = test::made(create("lab/arm0", kUrl));
  const auto services = discovery::find_services({});
  ASSERT_TRUE(services && services->services.size() == 1);
  Directory stranger(node_, services->services.front().url);
  const Claim claim{"lab/other", kOtherUrl, kInterface, {7, 1}, 1s};
  EXPECT_EQ(stranger.bind(claim).error().outcome, Outcome::kDenied);
  EXPECT_EQ(stranger.unbind("lab/arm0", {7, 1}).error().outcome, Outcome::kDenied);
  const auto bound = directory_.bind(claim);
  ASSERT_FALSE(bound);
  test::expect_text(bound.error().text(), {"only a registry takes names for others"});
}

TEST_F(Discovery, RefusesANameThatAnotherServerOfThisHostHolds) {
  ServedRegistry other;
  const auto announced = announce(other, /*is_registry=*/false);
  ASSERT_TRUE(Directory(node_, other.url()).bind({"lab/arm0", kOtherUrl, kInterface, {7, 1}, 1h}));
  const auto registration = create("lab/arm0", kUrl);
  ASSERT_FALSE(registration);
  test::expect_text(registration.error().text(),
                    {"is held by another server of this host", kOtherUrl});
}

// The finder never silently picks one of two servers.
TEST_F(Discovery, ReportsANameOfTwoServersAsAmbiguous) {
  const auto registration = test::made(create("lab/arm0", kUrl));
  ServedRegistry other;
  const auto announced = announce(other, /*is_registry=*/false);
  ASSERT_TRUE(Directory(node_, other.url()).bind({"lab/arm0", kOtherUrl, kInterface, {7, 1}, 1h}));
  ASSERT_TRUE(Directory(node_, other.url()).bind({"lab/x", kUrl, kInterface, {7, 1}, 1h}));
  const auto entry = directory_.resolve("lab/arm0");
  ASSERT_FALSE(entry);
  EXPECT_TRUE(entry.error().is_ambiguous);
  test::expect_text(entry.error().text(),
                    {"bound twice", kUrl, kOtherUrl, "process", "of this host"});
  const auto listed = directory_.list();
  ASSERT_TRUE(listed && listed->size() == 3);
  EXPECT_TRUE((*listed)[0].is_duplicate && (*listed)[1].is_duplicate);
  EXPECT_FALSE((*listed)[2].is_duplicate);
  EXPECT_EQ(directory_.find({.predicate = "name == 'lab/arm0'"})->entries.size(), 2U);
  EXPECT_EQ(url_of("lab/x"), kUrl);
}

TEST_F(Discovery, UsesTheRegistryWhoseSocketExists) {
  ServedRegistry registry;
  const auto announced = announce(registry);
  const auto registration = test::made(create("lab/arm0", kUrl));
  EXPECT_EQ(Directory(node_, registry.url()).resolve("lab/arm0")->url, kUrl);
  EXPECT_EQ(discovery::find_services({})->services.size(), 1U) << "it serves no names itself";
  EXPECT_TRUE(directory_.bind({"lab/x", kUrl, kInterface, {7, 1}, 1s}));
}

// If a registry refuses a name, the name is not served beside it.
TEST_F(Discovery, LeavesTheDecisionToTheRegistry) {
  ServedRegistry registry;
  const auto announced = announce(registry);
  ASSERT_TRUE(directory_.bind({"lab/arm0", kOtherUrl, kInterface, {7, 1}, 1h}));
  const auto registration = create("lab/arm0", kUrl);
  ASSERT_FALSE(registration);
  test::expect_text(registration.error().text(), {kOtherUrl});
}

TEST_F(Discovery, MovesToARegistryThatAppearsAndBackWhenItGoes) {
  const auto registration = test::made(create("lab/arm0", kUrl));
  std::vector<std::string> reported;
  std::mutex mutex;
  const auto watch = NameWatch::start(node_, std::string(kThisHost), {},
                                      {.on_change = [&](const NameChange& change) {
                                        const std::lock_guard lock(mutex);
                                        reported.push_back(change.entry.name);
                                      }});
  ASSERT_TRUE(watch) << watch.error().text();
  ServedRegistry registry;
  auto announced = announce(registry);
  EXPECT_TRUE(test::await([&] { return said_.have("is now bound at " + registry.url()); }));
  // The program's own service ends afterwards; the name is found all the time.
  EXPECT_TRUE(test::await([&] {
    EXPECT_EQ(url_of("lab/arm0"), kUrl);
    return discovery::find_services({})->services.size() == 1;
  }));
  announced.reset();
  registry.stop();
  EXPECT_TRUE(test::await([&] { return said_.have("which this program serves itself, no more"); }));
  EXPECT_TRUE(test::await([&] { return url_of("lab/arm0") == kUrl; }));
  EXPECT_TRUE(registration->is_bound());
  const std::lock_guard lock(mutex);
  EXPECT_EQ(reported, std::vector<std::string>{"lab/arm0"}) << "watchers see no change";
}

TEST_F(Discovery, LetsBindingsFollowAMovedName) {
  RegistryResolver resolver(node_);
  auto registration = create("lab/arm0", kUrl);
  ASSERT_TRUE(registration);
  EXPECT_EQ(resolver.resolve("lab/arm0", rt::now() + 20s).value_or(""), kUrl);
  registration = unexpected{SetupError{}};
  registration = create("lab/arm0", kOtherUrl);
  ASSERT_TRUE(registration);
  EXPECT_TRUE(test::await([&] { return resolver.move_count() == 1; }));
  EXPECT_EQ(resolver.resolve("lab/arm0", rt::now() + 20s).value_or(""), kOtherUrl);
}

// A program has ended without a message; only the kernel shows that.
TEST_F(Discovery, SkipsProgramsThatHaveEnded) {
  ServedRegistry other;
  auto announced = announce(other, /*is_registry=*/false);
  const std::string file = std::filesystem::directory_iterator(folder_)->path();
  std::filesystem::rename(file, file + "0");
  announced.reset();
  EXPECT_FALSE(std::filesystem::is_empty(folder_));
  EXPECT_TRUE(discovery::find_services({})->services.empty());
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(Discovery, ReportsThatItAsksALimitedNumberOfServers) {
  std::vector<std::unique_ptr<discovery::Announcement>> announced;
  for (std::uint16_t i = 0; i < discovery::kLocalServiceCountMax + 1; ++i) {
    auto made = discovery::Announcement::create(
        {}, {false, {"127.0.0.1"}, static_cast<std::uint16_t>(20'000 + i)});
    ASSERT_TRUE(made) << made.error().text();
    announced.push_back(std::move(*made));
  }
  const auto found = discovery::find_services({});
  ASSERT_TRUE(found);
  EXPECT_EQ(found->services.size(), discovery::kLocalServiceCountMax);
  ASSERT_EQ(found->notes.size(), 1U);
  test::expect_text(found->notes.front(), {"only 64 of this host's 65 servers"});
}

// A server that does not answer takes its share of the time, and is reported.
TEST_F(Discovery, ReportsAServerThatDoesNotAnswer) {
  const auto registration = test::made(create("lab/arm0", kUrl));
  ServedRegistry other;
  const auto announced = announce(other, /*is_registry=*/false);
  const std::string url = other.url();
  other.stop();
  EXPECT_EQ(url_of("lab/arm0"), kUrl);
  ASSERT_EQ(directory_.notes().size(), 1U);
  test::expect_text(directory_.notes().front(), {"no name service answers at " + url});
}

TEST_F(Discovery, RefusesAnUnsafeFolder) {
  std::filesystem::permissions(folder_, std::filesystem::perms::all);
  const auto listed = directory_.list();
  ASSERT_FALSE(listed);
  test::expect_text(listed.error().text(), {"others may enter it"});
}

/// A query and its answers, in a network namespace of this process.
class Question {
 public:
  explicit Question(const std::string& address) : socket_(*transport::LanSocket::open(address)) {}
  void send(ConstBytes bytes, const std::string& to) {
    static_cast<void>(socket_.send(bytes, {transport::parse_address(to), discovery::kPort}));
  }
  /// The answer to `bytes`; empty if none comes.
  [[nodiscard]] std::optional<discovery::Datagram> ask(ConstBytes bytes, const std::string& to,
                                                       Duration patience = 20s) {
    send(bytes, to);
    std::array<std::byte, 2 * discovery::kDatagramSize> buffer{};
    for (const MonotonicTime end = rt::now() + patience; rt::now() < end;) {
      const ConstBytes answer = socket_.receive(buffer, from);
      size = answer.size();
      if (size > 0) return discovery::decode(answer);
      rt::sleep_until(rt::now() + 1ms);
    }
    return std::nullopt;
  }

  [[nodiscard]] bool is_unanswered(ConstBytes bytes, const std::string& to) {
    return !ask(bytes, to, 100ms);
  }

  transport::LanPeer from{};  ///< The sender of the last answer.
  std::size_t size = 0;

 private:
  transport::LanSocket socket_;
};

/// Whether the finder accepts an answer whose number is that of the query plus `difference`.
bool takes_answer(std::uint64_t difference) {
  auto liar = transport::LanSocket::open("10.77.0.1", discovery::kPort);
  std::atomic<bool> is_over = false;
  std::thread answering([&] {
    std::array<std::byte, discovery::kDatagramSize> buffer{};
    while (!is_over) {
      transport::LanPeer from;
      const auto query = discovery::decode(liar->receive(buffer, from));
      if (query) {
        static_cast<void>(liar->send(discovery::encode({.is_answer = true,
                                                        .number = query->number + difference,
                                                        .services = {{6000, true, 1}}}),
                                     from));
      }
      rt::sleep_until(rt::now() + 1ms);
    }
  });
  const auto found = discovery::find_services(*discovery::parse_scope("10.77.0.1"));
  is_over = true;
  answering.join();
  return found && std::ranges::any_of(found->services, [](const auto& service) {
           return service.url == "rtpm://10.77.0.1:6000/rtpm/names";
         });
}

/// The faults of a program that answers for 10.77.0.1 in domain 7; empty if there is none.
std::string faults_of_answers() {
  const bool has_network =
      unshare(CLONE_NEWNET) == 0 &&
      std::system(
          "ip link add d0 type veth peer name d1 && ip link set d0 up && ip link set d1 up && "
          "ip link set lo up && ip address add 10.77.0.1/24 dev d0") == 0;
  if (!has_network) return "no network";
  // hp-10.1-5
  if (!takes_answer(0)) return "an answer is not taken";
  if (takes_answer(1)) return "an answer to another query is taken";
  const auto scope = discovery::parse_scope("lan:7@d0");
  const auto local = discovery::Announcement::create(*scope, {false, {"127.0.0.1"}, 5000});
  Question question("10.77.0.1");
  const auto query = [](std::uint8_t domain) {
    return discovery::encode({.domain = domain, .number = 42});
  };
  // hp-10.1-3: services that only this host reaches are not announced.
  if (!local || !question.is_unanswered(query(7), "239.255.43.7"))
    return "a loopback address is announced";
  const auto announced = discovery::Announcement::create(*scope, {true, {"10.77.0.1"}, 5001});
  const auto second = discovery::Announcement::create(*scope, {false, {"10.77.0.1"}, 5002});
  if (!announced || !second) return announced.error().text();
  // hp-10.1-4: each answer has its own service, from the served address, no larger than the query.
  const auto answer = question.ask(query(7), "239.255.43.7");
  if (!answer || !answer->is_answer || answer->number != 42 || answer->services.size() != 1) {
    return "no answer to the group";
  }
  if (question.from.ipv4 != transport::parse_address("10.77.0.1")) return "it is from elsewhere";
  if (question.size != discovery::kDatagramSize) return "it is of another size";
  Question other("10.77.0.1");
  if (!other.is_unanswered(query(8), "239.255.43.7")) return "an answer to another domain";
  const auto all = other.ask(query(8), "10.77.0.1");
  if (!all || all->services.size() != 2 || !all->services.front().is_registry) {
    return "a query to the host finds not all, registries first";
  }
  if (!other.is_unanswered(discovery::encode({.is_answer = true}), "10.77.0.1"))
    return "an answer answered";
  if (!other.is_unanswered(ConstBytes(query(7)).first(64), "10.77.0.1"))
    return "a short query answered";
  // hp-10.1-6
  for (int i = 0; i < 60; ++i)
    other.send(query(7), "10.77.0.1");
  const bool is_limited = test::await([&] {
    const auto now = second->get()->counts();
    return now.suppressed >= 20 && now.answered + now.suppressed >= 60;
  });
  if (!is_limited) return "answers are not limited";
  const auto counts = second->get()->counts();
  if (counts.malformed != 2 || announced->get()->counts().other_domain != 1)
    return "it does not count what it drops";
  const auto found = discovery::find_services(*scope);
  return found && found->services.size() == 3 ? "" : "the finder does not find them";
}

TEST_F(Discovery, AnswersTheLanWithinTheRules) {
  if (geteuid() != 0) GTEST_SKIP() << "a network of its own takes root";
  const test::ChildResult child = test::run_in_child(faults_of_answers);
  if (child.said == "no network") GTEST_SKIP() << "no network namespace: " << child.errors;
  EXPECT_EQ(child.said, "") << child.errors;
  test::expect_text(child.errors,
                    {"discovery: domain 7 on d0 (10.77.0.1), group 239.255.43.7:7423",
                     "no answers to the LAN: 127.0.0.1 is no IPv4 address of a network"});
}

TEST(Scope, IsReadFromText) {
  using discovery::parse_scope;
  using discovery::Scope;
  EXPECT_EQ(parse_scope("rtpm://h:1/n")->kind, Scope::Kind::kUrl);
  EXPECT_EQ(parse_scope("host")->kind, Scope::Kind::kHost);
  EXPECT_EQ(parse_scope("lan@eth0")->interface, "eth0");
  EXPECT_EQ(parse_scope("lan@eth0")->domain, 0);
  EXPECT_EQ(parse_scope("lan:255@any")->domain, 255);
  const auto hosts = parse_scope("10.0.0.5,labpc:7421");
  ASSERT_TRUE(hosts && hosts->hosts.size() == 2);
  EXPECT_EQ(hosts->hosts[0].port, 0);
  EXPECT_EQ(hosts->hosts[1].host, "labpc");
  EXPECT_EQ(hosts->hosts[1].port, 7421);
  for (const char* const bad : {"", "lan", "lan@", "lan:256@eth0", "lan:x@eth0", "lan:7", "a,",
                                "a,,b", "a:0", "a:x", "a b", "a:65536"})
    EXPECT_FALSE(parse_scope(bad)) << bad;
}

// hp-10.1-6
TEST(AnswerLimit, BoundsAnswersToAHostAndInAll) {
  discovery::AnswerLimit limit;
  const MonotonicTime begin = rt::now();
  const auto admitted = [&](std::uint32_t host, MonotonicTime now) {
    int count = 0;
    for (int i = 0; i < 1000; ++i)
      count += limit.admit(host, now) ? 1 : 0;
    return count;
  };
  EXPECT_EQ(admitted(1, begin), 20);
  EXPECT_EQ(admitted(1, begin + 500ms), 0);
  EXPECT_EQ(admitted(2, begin + 500ms), 20);
  int count = 40;
  for (std::uint32_t host = 3; host < 100; ++host)
    count += admitted(host, begin + 600ms);
  EXPECT_EQ(count, 200);
  EXPECT_EQ(admitted(1, begin + 2s), 20);
}

TEST(NameViews, ReportANameOnce) {
  using Kind = NameChange::Kind;
  NameViews views;
  const NameEntry entry{.name = "lab/arm0", .url = kUrl, .interface = kInterface, .revision = 1};
  NameEntry elsewhere = entry;
  elsewhere.revision = 77;
  EXPECT_EQ(views.take("own", {Kind::kBound, entry}).change->kind, Kind::kBound);
  EXPECT_FALSE(views.take("registry", {Kind::kBound, elsewhere}).change);
  EXPECT_FALSE(views.take("own", {Kind::kGone, entry}).change);
  elsewhere.url = kOtherUrl;
  EXPECT_EQ(views.take("registry", {Kind::kChanged, elsewhere}).change->kind, Kind::kChanged);
  const auto second = views.take("own", {Kind::kBound, entry});
  test::expect_text(second.duplicate, {"bound twice"});
  EXPECT_TRUE(second.change->entry.is_duplicate);
  EXPECT_EQ(views.take("own", {Kind::kGone, entry}).change->kind, Kind::kChanged);
  EXPECT_EQ(views.names_of("registry").size(), 1U);
  EXPECT_EQ(views.take("registry", {Kind::kGone, elsewhere}).change->kind, Kind::kGone);
  EXPECT_TRUE(views.names_of("registry").empty());
}

}  // namespace
}  // namespace rtpm::names
