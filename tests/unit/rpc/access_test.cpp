#include <gtest/gtest.h>

#include "secured_server.hpp"

// A server that asks its callers for grants, beyond the matrix of who may do what.
namespace rtpm::rpc {
namespace {

using namespace test;

TEST(SecuredServer, TellsItsMethodsWhoCalls) {
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
  EXPECT_EQ(access::to_text(vault.last_subject), own_user());
  EXPECT_EQ(vault.name(), "tester");
  EXPECT_EQ(vault.last_role_elsewhere, Role::kConfigure);
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

TEST(SecuredServer, IsOpenWithoutGrants) {
  EchoServer server;
  Node node(quiet_node(Transport::kUdp));
  EXPECT_TRUE(bind_echo(node, server).call(echo::kEcho, {}));
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

}  // namespace
}  // namespace rtpm::rpc
