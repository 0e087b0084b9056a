#include "rtpm/names/directory.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <mutex>
#include <thread>

#include "model/name.hpp"
#include "names.rtpm.hpp"
#include "registry_fixture.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/text.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::names {
namespace {

using namespace std::chrono_literals;

constexpr Owner kArm{.id = 1, .epoch = 10};
constexpr Owner kStranger{.id = 2, .epoch = 1};

// Leases outlast every test, even on a slow machine.
Claim claim(std::string_view name, Owner owner = kArm) {
  return {.name = name,
          .url = "rtpm://127.0.0.1:4711/object",
          .interface = "lab.Arm",
          .owner = owner,
          .lease = 1h};
}

class DirectoryOver : public testing::TestWithParam<rpc::Transport> {
 protected:
  ServedRegistry registry_;
  rpc::Node node_{{.transport = GetParam()}};
  Directory directory_{node_, registry_.url(), 20s};
};

INSTANTIATE_TEST_SUITE_P(Transports, DirectoryOver,
                         testing::Values(rpc::Transport::kUdp, rpc::Transport::kTcp,
                                         rpc::Transport::kSharedMemory),
                         [](const auto& transport) {
                           return std::string(to_string(transport.param));
                         });

TEST_P(DirectoryOver, BindsResolvesListsAndUnbinds) {
  const Claim arm{"lab/arm0", "rtpm://10.0.0.1:5/lab/arm0", "lab.Arm", kArm, 1h};
  ASSERT_TRUE(directory_.bind(arm));
  ASSERT_TRUE(directory_.bind(claim("hall/eye")));
  const auto entry = directory_.resolve("lab/arm0");
  ASSERT_TRUE(entry) << entry.error().text();
  EXPECT_EQ(entry->name, arm.name);
  EXPECT_EQ(entry->url, arm.url);
  EXPECT_EQ(entry->interface, arm.interface);
  EXPECT_GT(entry->lease_left, 0s);
  EXPECT_LE(entry->lease_left, 1h);
  const auto all = directory_.list();
  ASSERT_TRUE(all) << all.error().text();
  ASSERT_EQ(all->size(), 2U);
  EXPECT_EQ(all->at(0).name, "hall/eye");
  EXPECT_EQ(all->at(1).url, arm.url);
  ASSERT_EQ(directory_.list("lab")->size(), 1U);
  ASSERT_EQ(directory_.list("nowhere")->size(), 0U);
  ASSERT_TRUE(directory_.renew("lab/arm0", kArm, 1h));
  ASSERT_TRUE(directory_.unbind("lab/arm0", kArm));
  EXPECT_FALSE(directory_.resolve("lab/arm0"));
}

TEST_P(DirectoryOver, DescribesRefusals) {
  ASSERT_TRUE(directory_.bind(claim("lab/arm0")));

  const auto taken = directory_.bind(claim("lab/arm0", kStranger));
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().outcome, Outcome::kAlreadyBound);
  EXPECT_EQ(taken.error().holder_url, "rtpm://127.0.0.1:4711/object");
  EXPECT_GT(taken.error().holder_lease_left, 0s);
  test::expect_text(taken.error().text(),
                    {"'lab/arm0' is held by another server", "rtpm://127.0.0.1:4711/object"});

  const auto missing = directory_.resolve("lab/arm1/tip");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().outcome, Outcome::kNotFound);
  test::expect_text(missing.error().text(), {"nothing is at 'lab/arm1'"});

  EXPECT_EQ(directory_.renew("lab/arm0", kStranger, 1h).error().outcome, Outcome::kNotOwner);
  EXPECT_EQ(directory_.unbind("lab/arm0", kStranger).error().outcome, Outcome::kNotOwner);
  EXPECT_EQ(directory_.renew("lab/arm0", kArm, -1s).error().outcome, Outcome::kBadLease);
  EXPECT_EQ(directory_.list("lab/").error().outcome, Outcome::kBadName);
  EXPECT_EQ(directory_.bind({"a", "nonsense", "lab.Arm", kArm, 1h}).error().outcome,
            Outcome::kBadUrl);
  EXPECT_EQ(directory_.rebind(claim("lab/arm0", kStranger)).error().outcome,
            Outcome::kAlreadyBound);
  Claim taking = claim("lab/arm0", kStranger);
  taking.holder_revision = 1;
  EXPECT_EQ(directory_.rebind(taking).error().outcome, Outcome::kStaleRevision);
  taking.holder_revision = taken.error().holder_revision;
  EXPECT_EQ(directory_.resolve("lab/arm0")->revision, taking.holder_revision);
  const auto replaced = directory_.rebind(taking);
  ASSERT_TRUE(replaced) << replaced.error().text();
  EXPECT_NE(replaced->revision, taking.holder_revision);
  EXPECT_TRUE(directory_.unbind("lab/arm0", kStranger));
}

TEST_P(DirectoryOver, ListsHundredsOfTheLongestNames) {
  const std::string prefix = std::string(64, 'p') + '/' + std::string(64, 'q') + '/';
  const std::string url = "rtpm://255.255.255.255:65535/" + std::string(200, 'u');
  const std::string interface(kInterfaceSizeMax, 'I');
  std::vector<std::string> names;
  for (int i = 100; i < 350; ++i) {
    names.push_back(prefix + std::to_string(i) + std::string(61, 'x'));
    const auto bound = directory_.bind({names.back(), url, interface, kArm, 1h});
    ASSERT_TRUE(bound) << bound.error().text();
  }
  const auto listed = directory_.list(std::string(64, 'p'));
  ASSERT_TRUE(listed) << listed.error().text();
  ASSERT_EQ(listed->size(), names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    EXPECT_EQ(listed->at(i).name, names[i]);
    EXPECT_EQ(listed->at(i).url, url);
    EXPECT_EQ(listed->at(i).interface, interface);
  }
}

TEST_P(DirectoryOver, ReportsThatNoRegistryAnswers) {
  const std::string url = unserved_url();
  for (Directory directory(node_, url);
       const auto& error :
       {directory.resolve("lab/arm0").error(), directory.bind(claim("lab/arm0")).error()}) {
    EXPECT_EQ(error.outcome, std::nullopt);
    test::expect_text(error.text(), {"no registry answers at " + url,
                                     "Remedy: start rtpm-registryd, or give --registry URL."});
  }
}

// This error must not advise to start the registry.
TEST(DirectoryWithoutDescriptors, ReportsThatTheRegistryWasNotAsked) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    rpc::Node node;
    Directory directory(node, "rtpm://127.0.0.1:4711/rtpm/names");
    const rlimit few{64, 64};
    setrlimit(RLIMIT_NOFILE, &few);
    while (dup(STDERR_FILENO) >= 0) {
    }
    const auto listed = directory.list();
    return listed ? "it was listed" : listed.error().text();
  });
  rtpm::test::expect_text(child.said,
                          {"the registry at rtpm://127.0.0.1:4711/rtpm/names was not asked",
                           "Too many open files", "Remedy: raise the limit of open files"});
  EXPECT_EQ(child.said.find("start rtpm-registryd"), std::string::npos) << child.said;
}

TEST_P(DirectoryOver, ReportsAMalformedRegistryUrl) {
  for (const char* const wrong : {"", "lan:7", "lab/registry", "http://127.0.0.1:80/names"}) {
    // The resolver could look up a name by itself, for ever.
    RegistryResolver resolver(node_, wrong);
    node_.use(resolver);
    const auto url = resolver.resolve("lab/arm0", kNever);
    ASSERT_FALSE(url);
    test::expect_text(url.error().text(), {"'" + std::string(wrong) + "' is no URL of a registry",
                                           "give --registry rtpm://host:port/path"});
  }
}

TEST_P(DirectoryOver, ReportsAUrlWithoutARegistry) {
  Directory directory(node_, registry_.server().url("another/object"));
  const auto entry = directory.resolve("lab/arm0");
  ASSERT_FALSE(entry);
  test::expect_text(entry.error().text(), {"no object 'another/object'"});
}

TEST_P(DirectoryOver, LetsANodeBindByName) {
  RegistryResolver resolver(node_, registry_.url());
  node_.use(resolver);
  const std::string url = registry_.url();
  ASSERT_TRUE(directory_.bind({"rtpm/registry", url, NamesClient::interface().name, kArm, 1h}));
  auto client = NamesClient::bind(node_, "rtpm/registry");
  ASSERT_TRUE(client) << client.error().text();
  EXPECT_EQ(client->binding().url(), registry_.url());
  ResolveRequestT request;
  request.name = "rtpm/registry";
  EXPECT_TRUE(client->resolve(request));

  const auto unknown = NamesClient::bind(node_, "rtpm/registyr");
  ASSERT_FALSE(unknown);
  test::expect_text(unknown.error().text(),
                    {"'rtpm/registyr' is not bound, nothing is at 'rtpm/registyr'"});
}

TEST_P(DirectoryOver, ResolvesObjectsBelowABoundName) {
  ASSERT_TRUE(directory_.bind(claim("lab/arm0")));
  EXPECT_EQ(*directory_.url_of("lab/arm0"), "rtpm://127.0.0.1:4711/object");
  EXPECT_EQ(*directory_.url_of("lab/arm0/config"), "rtpm://127.0.0.1:4711/object/config");
  EXPECT_EQ(*directory_.url_of("lab/arm0/a/b"), "rtpm://127.0.0.1:4711/object/a/b");
  EXPECT_EQ(directory_.url_of("lab/arm1/config").error().outcome, Outcome::kNotFound);
  EXPECT_EQ(directory_.url_of("lab").error().outcome, Outcome::kIsADirectory);
  RegistryResolver resolver(node_, registry_.url());
  EXPECT_EQ(*resolver.resolve("lab/arm0/config", rt::now() + 20s),
            "rtpm://127.0.0.1:4711/object/config");
}

TEST_P(DirectoryOver, AnswersAListInPagesThatFitADatagram) {
  // Names of many lengths, so that pages end at many positions.
  for (std::size_t i = 0; i < 150; ++i) {
    const std::string name = "n" + std::to_string(1000 + i) + std::string(i % 60, 'n');
    const std::string url = "rtpm://h:1/" + std::string(1 + i * 7 % 190, 'u');
    ASSERT_TRUE(directory_.bind({name, url, "I", kArm, 1h}));
  }
  auto client = NamesClient::bind(node_, registry_.url());
  ASSERT_TRUE(client) << client.error().text();
  std::string after;
  std::size_t count = 0;
  std::size_t largest = 0;
  for (bool is_last = false; !is_last;) {
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(CreateListRequestDirect(builder, nullptr, after.c_str()));
    const rpc::MethodDescriptor* list = nullptr;
    for (const rpc::MethodDescriptor& method : NamesClient::interface().methods) {
      if (method.name == "list") list = &method;
    }
    ASSERT_NE(list, nullptr);
    auto reply = client->binding().call(*list, rpc::table_bytes(builder));
    ASSERT_TRUE(reply) << rpc::to_string(reply.error());
    ASSERT_LE(reply->bytes().size(), wire::kDatagramPayloadSizeMax);
    ASSERT_TRUE(rpc::is_valid_table<ListReply>(reply->bytes()));
    largest = std::max(largest, reply->bytes().size());
    const auto* const page = flatbuffers::GetRoot<ListReply>(reply->bytes().data());
    ASSERT_GT(page->entries()->size(), 0U);
    count += page->entries()->size();
    after = page->entries()->Get(page->entries()->size() - 1)->name()->str();
    is_last = page->is_last();
  }
  EXPECT_EQ(count, 150U);
  // Large pages use most of a datagram.
  EXPECT_GT(largest, wire::kDatagramPayloadSizeMax / 2);
}

// hp-12-4
TEST_P(DirectoryOver, RefusesMalformedRequests) {
  auto client = NamesClient::bind(node_, registry_.url());
  ASSERT_TRUE(client) << client.error().text();
  const std::vector<std::byte> garbage(200, std::byte{0xa5});
  const auto expect_bad_request = [](const auto& reply) {
    ASSERT_FALSE(reply);
    EXPECT_EQ(reply.error(), rpc::CallError::kBadRequest);
  };
  for (const std::size_t size : {0U, 3U, 8U, 200U}) {
    const ConstBytes request = ConstBytes(garbage).first(size);
    expect_bad_request(client->bind_encoded(request));
    expect_bad_request(client->renew_encoded(request));
    expect_bad_request(client->resolve_encoded(request));
    expect_bad_request(client->list_encoded(request));
    expect_bad_request(client->unbind_encoded(request));
  }
  // A table that lacks a required field is malformed, too.
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(flatbuffers::Offset<BindRequest>(builder.EndTable(builder.StartTable())));
  expect_bad_request(client->bind_encoded(rpc::table_bytes(builder)));
  // The store refuses every byte that a name may not contain, and the registry survives.
  ResolveRequestT request;
  request.name = std::string("lab/\0\xff\x1b", 7);
  const auto reply = client->resolve(request);
  ASSERT_TRUE(reply);
  EXPECT_EQ((*reply)->answer()->outcome(), OutcomeCode::BadName);
  EXPECT_EQ((*reply)->answer()->component(), 1);
  request.name = std::string(1000, '/');
  EXPECT_EQ((*client->resolve(request))->answer()->outcome(), OutcomeCode::BadName);
  ASSERT_TRUE(directory_.bind(claim("lab/arm0")));
}

TEST(Directory, GivesUpOnARegistryThatIsSilent) {
  // A socket that accepts everything and never answers.
  const int silent = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(bind(silent, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(getsockname(silent, reinterpret_cast<sockaddr*>(&address), &size), 0);
  rpc::Node node({.transport = rpc::Transport::kUdp});
  const std::string url = "rtpm://127.0.0.1:" + std::to_string(ntohs(address.sin_port)) + "/r";
  Directory directory(node, url, 20ms);
  const auto entry = directory.resolve("lab/arm0");
  ASSERT_FALSE(entry);
  test::expect_text(entry.error().text(), {"no registry answers at " + url});
  close(silent);
}

TEST(Directory, ServesSeveralLanesAndCallersAtOnce) {
  ServedRegistry registry({}, {{.name = "low"}, {.name = "high", .low = 16000}});
  rpc::Node node;
  Directory directory(node, registry.url());
  std::vector<std::thread> callers;
  callers.reserve(4);
  for (int caller = 0; caller < 4; ++caller) {
    callers.emplace_back([&directory, caller] {
      // Each lane gets two callers.
      set_current_priority(Priority{caller * 10000});
      for (int i = 0; i < 25; ++i) {
        const std::string name = "caller" + std::to_string(caller) + "/" + std::to_string(i);
        const auto bound = directory.bind(claim(name));
        EXPECT_TRUE(bound) << bound.error().text();
        EXPECT_TRUE(directory.resolve(name));
      }
    });
  }
  for (std::thread& caller : callers)
    caller.join();
  EXPECT_EQ(directory.list()->size(), 100U);
}

/// The messages of a registry.
struct Sentences {
  RegistryReport taker() {
    return [this](std::string_view sentence) {
      const std::lock_guard lock(mutex);
      all.emplace_back(sentence);
    };
  }
  std::mutex mutex;
  std::vector<std::string> all;
};

// One program of this host claims to be thousands of servers.
TEST(Directory, KeepsSlotsForOthersWhenOneHostInventsServers) {
  Sentences sentences;
  const auto servant = make_servant({.name_count_own_host_max = 40, .owner_count_own_host_max = 30},
                                    sentences.taker());
  ServedRegistry registry(*servant);
  rpc::Node node;
  Directory directory(node, registry.url());
  const auto honest = Registration::create(node, registry.url(), "lab/arm0",
                                           "rtpm://127.0.0.1:4711/lab/arm0", "lab.Arm");
  ASSERT_TRUE(honest) << honest.error().text();
  int count = 0;
  std::optional<Outcome> refused;
  for (; count < 100; ++count) {
    const auto bound = directory.bind(
        claim("n" + std::to_string(count), {100U + static_cast<unsigned>(count), 1}));
    if (bound) {
      EXPECT_EQ(bound->lease, 10s) << "a new name has no lease of an hour";
      continue;
    }
    EXPECT_EQ(bound.error().outcome, Outcome::kHostOwnersFull);
    test::expect_text(bound.error().text(), {"--servers-per-host-max"});
    refused = bound.error().outcome;
  }
  EXPECT_TRUE(refused);
  EXPECT_EQ(directory.list()->size(), 30U);
  EXPECT_TRUE((*honest)->is_bound());
  auto client = NamesClient::bind(node, registry.url());
  ASSERT_TRUE(client);
  {
    const auto report = client->report();
    ASSERT_TRUE(report) << rpc::to_string(report.error());
    EXPECT_EQ((*report)->name_count(), 30U);
    EXPECT_EQ((*report)->owner_count(), 30U);
    ASSERT_EQ((*report)->refused()->size(), 1U);
    EXPECT_EQ((*report)->refused()->Get(0)->outcome(), OutcomeCode::HostOwnersFull);
    EXPECT_EQ((*report)->refused()->Get(0)->count(), 71U);
    ASSERT_EQ((*report)->hosts()->size(), 1U);
    EXPECT_EQ((*report)->hosts()->Get(0)->host()->str(), "127.0.0.1");
    EXPECT_EQ((*report)->hosts()->Get(0)->name_count(), 30U);
  }
  const std::lock_guard lock(sentences.mutex);
  ASSERT_GE(sentences.all.size(), 1U);
  EXPECT_LT(sentences.all.size(), 71U) << "they are no flood themselves";
  test::expect_text(sentences.all[0],
                    {"refused a bind from 127.0.0.1: the name 'n29' is of one more server"});
}

TEST(Directory, ReportsTheFormerAndTheNewHolderOfATakenName) {
  Sentences sentences;
  const auto servant = make_servant({}, sentences.taker());
  ServedRegistry registry(*servant);
  rpc::Node node;
  Directory directory(node, registry.url());
  ASSERT_TRUE(directory.bind(claim("lab/arm0")));
  Claim taking = claim("lab/arm0", kStranger);
  taking.url = "rtpm://127.0.0.1:4712/object";
  taking.allows_takeover = true;
  ASSERT_TRUE(directory.rebind(taking));
  for (int i = 0; i < 10; ++i) {
    taking.owner.id = 10U + static_cast<unsigned>(i);
    ASSERT_TRUE(directory.rebind(taking));
  }
  const std::lock_guard lock(sentences.mutex);
  ASSERT_GE(sentences.all.size(), 1U);
  EXPECT_LT(sentences.all.size(), 11U);
  EXPECT_EQ(sentences.all[0],
            "the name 'lab/arm0' was taken from 'rtpm://127.0.0.1:4711/object', bound from "
            "127.0.0.1, by 'rtpm://127.0.0.1:4712/object' from 127.0.0.1");
}

TEST(Owner, IsTheSameForAllObjectsOfAServer) {
  const Owner owner = owner_of("rtpm://127.0.0.1:4711/lab/arm0");
  EXPECT_NE(owner.id, 0U);
  EXPECT_EQ(owner_of("rtpm://127.0.0.1:4711/lab/arm1"), owner);
  EXPECT_NE(owner_of("rtpm://127.0.0.1:4712/lab/arm0").id, owner.id);
  EXPECT_NE(owner_of("rtpm://127.0.0.2:4711/lab/arm0").id, owner.id);
}

TEST(DirectoryList, AsksTheNextRegistryIfOneDoesNotAnswer) {
  ServedRegistry registry;
  rpc::Node node{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  const std::string gone = unserved_url();
  Directory directory(node, gone + "," + registry.url());
  EXPECT_TRUE(directory.bind(claim("lab/arm0")));
  EXPECT_EQ(directory.list()->size(), 1U);
  Directory nowhere(node, gone + ",lab/names", 200ms);
  const auto refused = nowhere.list();
  ASSERT_FALSE(refused);
  test::expect_text(refused.error().text(), {",lab/names' is no URL of a registry"});
}

}  // namespace
}  // namespace rtpm::names
