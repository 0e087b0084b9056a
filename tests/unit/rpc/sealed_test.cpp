#include <gtest/gtest.h>

#include <thread>

#include "rtpm/access/files.hpp"
#include "rtpm/access/grants.hpp"
#include "rtpm/test/sealed_peer.hpp"
#include "secured_server.hpp"

// Sealed sessions of a real server, used by a minimal client of the protocol.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;
using rtpm::test::SealedPeer;
using Kind = SealedPeer::Kind;

std::string grant_for(const crypto::KeyPair& key, const std::string& what) {
  access::Subject subject;
  subject.kind = access::Subject::Kind::kKey;
  subject.key = key.public_key;
  return access::to_text(subject) + " " + what + "\n";
}

/// A server that serves echo to one key, whose grants can change.
class Sealed : public testing::TestWithParam<Transport> {
 protected:
  static ServerConfig config_with(const KeyFolder& folder, const std::string& grants) {
    ServerConfig config = quiet_config();
    config.host = "127.0.0.1";
    config.security.authorized_file = folder.write("authorized", grants);
    config.security.key_file = folder.file("key");
    return config;
  }
  void serve(const std::string& what = "role=command on=**") {
    server_.emplace(config_with(folder_, grant_for(key_, what)));
  }
  [[nodiscard]] SealedPeer peer(const crypto::KeyPair& key) {
    return {GetParam(), server_->server->port(), *server_->server->public_key(), key};
  }
  [[nodiscard]] SealedPeer peer() { return peer(key_); }
  [[nodiscard]] std::uint64_t dropped_for(wire::DropReason reason) const {
    return server_->server->counters().frames.dropped_for(reason);
  }

  KeyFolder folder_;
  crypto::KeyPair key_ = crypto::KeyPair::generate();
  std::optional<EchoServer> server_;
};

INSTANTIATE_TEST_SUITE_P(Both, Sealed, testing::Values(Transport::kUdp, Transport::kTcp),
                         [](const auto& row) {
                           return row.param == Transport::kUdp ? "Udp" : "Tcp";
                         });

TEST_P(Sealed, CarriesCallsOfAllSizes) {
  serve();
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  for (const std::size_t size : {0u, 1u, 48u, 1320u, 1321u, 1344u, 65448u, 65449u, 300'000u}) {
    Bytes payload(size);
    for (std::size_t i = 0; i < size; ++i)
      payload[i] = static_cast<std::byte>(i * 7);
    const SealedPeer::Reply reply = client.call(echo::kEcho.id, payload);
    ASSERT_TRUE(reply.is_ok()) << size;
    EXPECT_EQ(reply.payload, payload) << size;
    EXPECT_TRUE(wire::is_sealed(client.last_frame()));
  }
  EXPECT_EQ(server_->servant.run_count(), 9);
}

TEST_P(Sealed, RefusesAnUnknownKey) {
  serve();
  SealedPeer stranger = peer(crypto::KeyPair::generate());
  EXPECT_FALSE(stranger.open(500ms));
  EXPECT_EQ(stranger.sealed().hint(), wire::Status::kNotAllowed);
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  EXPECT_TRUE(client.call(echo::kEcho.id, bytes_of("a")).is_ok());
}

TEST_P(Sealed, DoesNotAnswerAClientOfAnotherServersKey) {
  serve();
  SealedPeer client(GetParam(), server_->server->port(), crypto::KeyPair::generate().public_key,
                    key_);
  EXPECT_FALSE(client.open(500ms));
  ASSERT_TRUE(client.sealed().other_key() || GetParam() == Transport::kTcp);
  EXPECT_TRUE(await([&] { return dropped_for(wire::DropReason::kBadSeal) > 0; }));
  EXPECT_EQ(server_->server->counters().frames.session_opened_count, 0u);
}

TEST_P(Sealed, RefusesUnsealedSessionsWithoutAGrantForAll) {
  serve();
  RawPeer plain(GetParam(), server_->server->port());
  EXPECT_FALSE(plain.open(500ms));
  folder_.write("authorized", grant_for(key_, "role=command on=**") +
                                  "anonymous role=observe on=** from=127.0.0.0/8\n");
  EXPECT_TRUE(await([&] {
    RawPeer again(GetParam(), server_->server->port());
    return again.open(200ms);
  }));
}

TEST_P(Sealed, DropsAForgedFrameAndEndsOnlyAConnection) {
  serve();
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  ASSERT_TRUE(client.call(echo::kEcho.id, bytes_of("a")).is_ok());
  Bytes forged = client.last_sent();
  forged[forged.size() - 24] = std::byte{9};  // The counter.
  forged.back() ^= std::byte{1};
  client.send_raw(forged);
  if (GetParam() == Transport::kUdp) {
    EXPECT_TRUE(client.call(echo::kEcho.id, bytes_of("b")).is_ok());
    client.send_raw(client.last_sent());
    EXPECT_TRUE(await([&] { return dropped_for(wire::DropReason::kReplayed) == 1; }));
    EXPECT_EQ(dropped_for(wire::DropReason::kBadSeal), 1u);
  } else {
    EXPECT_EQ(client.await().kind, Kind::kBroken);
  }
}

// The session ends after the file's change, in the middle of a call.
TEST_P(Sealed, ClosesTheSessionOfARevokedGrant) {
  serve();
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  ASSERT_TRUE(client.call(echo::kEcho.id, bytes_of("a")).is_ok());
  folder_.write("authorized", "anonymous role=observe on=nothing\n");
  EXPECT_EQ(client.await().kind, Kind::kClosed);
  EXPECT_TRUE(wire::is_sealed(client.last_frame()));
  EXPECT_FALSE(client.open(300ms));
}

TEST_P(Sealed, ClosesTheSessionOfANarrowedGrantOnly) {
  serve("role=command on=echo");
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  ASSERT_TRUE(client.call(echo::kEcho.id, bytes_of("a")).is_ok());
  folder_.write("authorized", grant_for(key_, "role=configure on=echo,other/**"));
  EXPECT_EQ(client.await(rt::now() + 1200ms).kind, Kind::kNothing);
  EXPECT_TRUE(client.call(echo::kEcho.id, bytes_of("b")).is_ok());
  folder_.write("authorized", grant_for(key_, "role=observe on=echo"));
  EXPECT_EQ(client.await().kind, Kind::kClosed);
  SealedPeer again = peer();
  EXPECT_TRUE(again.open());
}

TEST_P(Sealed, KeepsItsKeyOverARestart) {
  serve();
  const auto key = server_->server->public_key();
  ServerConfig config = config_with(folder_, grant_for(key_, "role=command on=**"));
  config.port = server_->server->port();
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  ASSERT_TRUE(client.call(echo::kEcho.id, bytes_of("a")).is_ok());
  server_->server->stop();
  EXPECT_EQ(client.await().kind, Kind::kClosed) << "by a sealed CLOSE";
  server_.reset();
  server_.emplace(config);
  EXPECT_EQ(server_->server->public_key(), key);
  SealedPeer again = peer();
  ASSERT_TRUE(again.open());
  EXPECT_TRUE(again.call(echo::kEcho.id, bytes_of("b")).is_ok());
}

TEST_P(Sealed, OpensSessionsInSeveralLanes) {
  ServerConfig config = config_with(folder_, grant_for(key_, "role=command on=**"));
  config.lanes = {quiet_lane(0), quiet_lane(10'000)};
  config.lanes[1].static_threads = 3;
  config.lanes[0].static_threads = 2;
  for (LaneConfig& lane : config.lanes)
    lane.buffered_request_max = 16;
  config.borrows = true;
  server_.emplace(config);
  const auto server_key = *server_->server->public_key();
  std::vector<std::thread> callers;
  std::atomic<int> good_count{0};
  for (int i = 0; i < 6; ++i) {
    callers.emplace_back([&, i] {
      SealedPeer client(GetParam(), server_->server->port(), server_key, key_,
                        Priority{i % 2 == 0 ? 100 : 20'000});
      if (!client.open()) return;
      Bytes payload(5000, static_cast<std::byte>(i));
      for (int call = 0; call < 100; ++call) {
        const SealedPeer::Reply reply = client.call(echo::kEcho.id, payload);
        if (reply.is_ok() && reply.payload == payload) ++good_count;
      }
    });
  }
  for (std::thread& caller : callers)
    caller.join();
  EXPECT_EQ(good_count, 600);
}

TEST(SecuredServer, ReportsWhyItHasNoKey) {
  const KeyFolder folder;
  ServerConfig config = quiet_config();
  config.security.authorized_file = folder.write("authorized", "anonymous role=observe on=**\n");
  config.security.key_file = folder.write("key", "nonsense");
  std::filesystem::permissions(config.security.key_file, std::filesystem::perms::owner_read);
  const auto created = Server::create(config);
  ASSERT_FALSE(created);
  expect_text(created.error().text(), {"server 'test'", folder.file("key")});
}

}  // namespace
}  // namespace rtpm::rpc
