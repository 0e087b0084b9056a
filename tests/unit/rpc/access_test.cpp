#include <gtest/gtest.h>

#include "secured_server.hpp"
#include "security/access_control.hpp"
#include "security/gatekeeper.hpp"
#include "security/handshake_rate.hpp"

// A server that checks its callers' grants, beyond the matrix of permissions.
namespace rtpm::rpc {
namespace {

using namespace test;

// A revoked grant ends its sessions within a second: one interval until the gatekeeper reads the
// grants, and as much for the lanes. Tests on a busy machine wait longer.
static_assert(2 * Gatekeeper::kLookInterval <= std::chrono::seconds{1});

TEST(SecuredServer, PassesTheCallersIdentityToItsMethods) {
  const KeyFolder folder;
  SecuredServer secured(folder,
                        own_user() + " name=tester role=command on=lab/arm0\n" + own_user() +
                            " role=configure on=lab/elsewhere\n",
                        {"lab/arm0"});
  Node node(quiet_node(Transport::kSharedMemory));
  auto binding = Binding::bind(node, secured.server->url("lab/arm0"), vault::kInterface);
  ASSERT_TRUE(binding) << binding.error().text();
  ASSERT_TRUE(binding->call(vault::kMove, {}));
  const vault::Vault& vault = *secured.vaults[0];
  EXPECT_EQ(access::to_text(vault.subject()), own_user());
  EXPECT_EQ(vault.name(), "tester");
  EXPECT_EQ(vault.role_elsewhere(), Role::kConfigure);
}

TEST(SecuredServer, RefusesPrioritiesAboveTheCeiling) {
  const KeyFolder folder;
  SecuredServer secured(folder, own_user() + " role=command on=** max-priority=100\n",
                        {"lab/arm0"});
  for (const Transport transport : {Transport::kSharedMemory, Transport::kLocal}) {
    Node node(quiet_node(transport));
    auto binding = Binding::bind(node, secured.server->url("lab/arm0"), vault::kInterface);
    ASSERT_TRUE(binding) << binding.error().text();
    EXPECT_TRUE(binding->call(vault::kMove, {}, {.priority = 100}));
    const auto refused = binding->call(vault::kMove, {}, {.priority = 101});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error(), CallError::kPriorityNotAllowed);
  }
  EXPECT_EQ(secured.vaults[0]->run_counts[1], 2);
}

TEST(SecuredServer, DoesNotStartOnAFileThatOthersCanWrite) {
  const KeyFolder folder;
  ServerConfig config = quiet_config();
  config.security.authorized_file = folder.write("authorized", "anonymous role=observe on=**\n");
  std::filesystem::permissions(config.security.authorized_file, std::filesystem::perms::all);
  const auto created = Server::create(config);
  ASSERT_FALSE(created);
  expect_text(created.error().text(), {"server 'test'", "others can write it", "chmod"});
}

// A caller through memory and one without a key lose their grants.
TEST(SecuredServer, EndsUnsealedSessionsWhoseGrantsAreRevoked) {
  for (const Transport transport : transports_of_host()) {
    const KeyFolder folder;
    const std::string others =
        "anonymous role=observe on=other\n" + own_user() + " role=observe on=other\n";
    SecuredServer secured(folder,
                          others + own_user() + " role=command on=lab/arm0\n" +
                              "anonymous role=command on=lab/arm0\n",
                          {"lab/arm0"});
    rtpm::test::RawPeer peer(transport, secured.server->port());
    ASSERT_TRUE(peer.open());
    folder.write("authorized", others);
    std::optional<wire::FrameKind> kind;
    if (const auto frame = peer.receive()) kind = wire::decode_frame(*frame)->kind;
    EXPECT_TRUE(kind == wire::FrameKind::kClose || peer.is_closed()) << static_cast<int>(transport);
  }
}

TEST(AccessControl, EndsSessionsNotReviewedForManyReloads) {
  const KeyFolder folder;
  auto control = AccessControl::open(folder.write("authorized", "uid:7 role=command on=a\n"));
  ASSERT_TRUE(control) << control.error().text();
  const CallOrigin origin = origin_of_user(7);
  const std::uint32_t since = (*control)->generation();
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_TRUE((*control)->keeps(origin, since)) << i;
    folder.write("authorized", "uid:7 role=command on=a\n# " + std::string(i, 'x') + "\n");
    EXPECT_TRUE((*control)->reload_if_changed());
  }
  EXPECT_FALSE((*control)->keeps(origin, since));
  EXPECT_TRUE((*control)->keeps(origin, (*control)->generation()));
}

// The server's own user may do everything, until a line limits its rights.
TEST(AccessControl, RestrictsItsOwnUserOnceNamed) {
  const KeyFolder folder;
  auto control = AccessControl::open(folder.write("authorized", "uid:7 role=command on=a\n"));
  ASSERT_TRUE(control) << control.error().text();
  const CallOrigin own = origin_of_user(access::this_user());
  const std::uint32_t since = (*control)->generation();
  EXPECT_TRUE((*control)->keeps(own, since));
  folder.write("authorized", own_user() + " role=command on=a\n");
  EXPECT_TRUE((*control)->reload_if_changed());
  EXPECT_FALSE((*control)->keeps(own, since));
  EXPECT_TRUE((*control)->keeps(own, (*control)->generation()));
}

TEST(HandshakeRate, AdmitsABurstAndThenOneEachInterval) {
  HandshakeRate rate;
  const MonotonicTime now = time_from_ns(1'000'000'000);
  int count = 0;
  while (count < 1000 && rate.admit(now))
    ++count;
  EXPECT_EQ(count, HandshakeRate::kBurst);
  EXPECT_FALSE(rate.admit(now + HandshakeRate::kInterval / 2));
  EXPECT_TRUE(rate.admit(now + HandshakeRate::kInterval));
  EXPECT_FALSE(rate.admit(now + HandshakeRate::kInterval));
}

// The log contains the events once the gatekeeper has written it, but no line for ordinary calls.
TEST(AuditLog, RecordsSessionsBindsRefusalsAndConfiguration) {
  const KeyFolder folder;
  {
    ServerConfig config = quiet_config();
    config.security.audit_file = folder.file("audit");
    SecuredServer secured(folder, own_user() + " name=tester role=configure on=lab/arm0\n",
                          {"lab/arm0", "lab/secret"}, config);
    Node node(quiet_node(Transport::kSharedMemory));
    auto binding = Binding::bind(node, secured.server->url("lab/arm0"), vault::kInterface);
    ASSERT_TRUE(binding) << binding.error().text();
    for (int i = 0; i < 1000; ++i)
      ASSERT_TRUE(binding->call(vault::kMove, {}));
    EXPECT_TRUE(binding->call(vault::kTune, {}));
    EXPECT_FALSE(binding->call(vault::kReset, {}));
    EXPECT_FALSE(Binding::bind(node, secured.server->url("lab/secret"), vault::kInterface));
    {
      RawPeer peer(Transport::kSharedMemory, secured.server->port());
      ASSERT_TRUE(peer.open());
      peer.send(peer.call_frame(1, vault::kRead.id));
      EXPECT_TRUE(peer.receive_answer(1));
    }
    EXPECT_TRUE(await([&] { return folder.read("audit").find(" ended ") != std::string::npos; }));
    folder.write("authorized", own_user() + " role=administer on=**\n");
    EXPECT_TRUE(
        await([&] { return folder.read("audit").find(" reloaded ") != std::string::npos; }));
  }
  const std::string text = folder.read("audit");
  const std::string who = " who=" + own_user() + " name=tester";
  expect_text(
      text,
      {" opened" + who + "\n", " ended" + who + "\n", " bound" + who + " path=lab/arm0 result=ok\n",
       " called" + who + " path=lab/arm0 method=tune role=configure result=ok\n",
       " refused" + who + " path=lab/arm0 method=reset role=administer result=not_allowed\n",
       " refused" + who + " path=lab/secret method=bind role=observe"});
  EXPECT_EQ(text.find("method=move"), std::string::npos);
  EXPECT_EQ(std::filesystem::status(folder.file("audit")).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
}

TEST(AuditLog, LogsTheLineThatWouldAllowARefusedCall) {
  const KeyFolder folder;
  testing::internal::CaptureStderr();
  {
    SecuredServer secured(folder, own_user() + " role=observe on=lab/*\n", {"lab/arm0"});
    Node node(quiet_node(Transport::kSharedMemory));
    auto binding = Binding::bind(node, secured.server->url("lab/arm0"), vault::kInterface);
    ASSERT_TRUE(binding) << binding.error().text();
    const auto refused = binding->call(vault::kTune, {});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error(), CallError::kNotAllowed);
  }
  expect_text(testing::internal::GetCapturedStderr(),
              {"refused: " + own_user() + " may not call tune of lab/arm0", "takes role configure",
               "add to " + folder.file("authorized") + ": " + own_user() +
                   " role=configure on=lab/arm0\n"});
}

}  // namespace
}  // namespace rtpm::rpc
