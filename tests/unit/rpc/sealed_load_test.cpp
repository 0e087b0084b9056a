#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "rtpm/access/grants.hpp"
#include "rtpm/test/other_hosts.hpp"
#include "rtpm/test/sealed_peer.hpp"
#include "secured_server.hpp"

// Sealed sessions of a real server under attack, and while their grants change.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;
using rtpm::test::SealedPeer;
using Kind = SealedPeer::Kind;

constexpr MethodDescriptor kWatch{1, "watch", 201, false, {}};
constexpr MethodDescriptor kLater{2, "later", 202, false, {}};
constexpr std::array kMethods{kWatch, kLater};
constexpr InterfaceDescriptor kSlowly{"test.Slowly", 4712, "by hand", kMethods};

/// Keeps each call open; the test ends it.
class SlowServant final : public Servant {
 public:
  [[nodiscard]] const InterfaceDescriptor& interface() const noexcept override { return kSlowly; }
  DispatchResult dispatch(std::uint16_t method, ConstBytes, MutableBytes,
                          const CallContext& context) override {
    if (method == kWatch.id) {
      writer = context.deferral->stream();
    } else {
      reply = context.deferral->defer();
    }
    has_call = true;
    return {};
  }
  ItemWriter writer;
  DeferredReply reply;
  std::atomic<bool> has_call{false};
};

/// A server with one object, for one key.
class SealedLoad : public testing::TestWithParam<Transport> {
 protected:
  void serve(Servant& first, ServerConfig config = quiet_config()) {
    const bool serves_echo = &first == &echo_;
    config.host = "127.0.0.1";
    allow("role=command on=**");
    config.security.authorized_file = folder_.file("authorized");
    config.security.key_file = folder_.file("key");
    auto created = Server::create(std::move(config));
    ASSERT_TRUE(created) << created.error().text();
    server_ = std::move(*created);
    ASSERT_TRUE(server_->add(serves_echo ? "echo" : "slow", first));
    ASSERT_TRUE(server_->start());
  }
  void TearDown() override {
    slow_.writer = {};
    slow_.reply = {};
    if (server_) server_->stop();
  }
  void allow(const std::string& what) {
    access::Subject subject;
    subject.kind = access::Subject::Kind::kKey;
    subject.key = key_.public_key;
    folder_.write("authorized", access::to_text(subject) + " " + what + "\n");
  }
  [[nodiscard]] SealedPeer peer() {
    return {GetParam(), server_->port(), *server_->public_key(), key_};
  }

  KeyFolder folder_;
  crypto::KeyPair key_ = crypto::KeyPair::generate();
  SlowServant slow_;
  echo::Servant echo_;
  std::unique_ptr<Server> server_;
};

INSTANTIATE_TEST_SUITE_P(Both, SealedLoad, testing::Values(Transport::kUdp, Transport::kTcp),
                         [](const auto& row) {
                           return row.param == Transport::kUdp ? "Udp" : "Tcp";
                         });

TEST_P(SealedLoad, CarriesItemsOfAllSizes) {
  serve(slow_);
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  ASSERT_TRUE(client.begin_stream(kWatch.id, 8));
  ASSERT_TRUE(await([&] { return slow_.has_call.load(); }));
  for (const std::size_t size : {0u, 48u, 1320u, 1321u, 16'000u, 1u, 2u, 3u, 4u, 5u, 6u, 7u, 8u}) {
    const Bytes item(size, static_cast<std::byte>(size));
    ASSERT_TRUE(slow_.writer.write(item));
    const auto received = client.next_item();
    ASSERT_TRUE(received) << size;
    EXPECT_EQ(*received, item);
  }
  slow_.writer.finish();
  EXPECT_TRUE(client.await().is_ok());
}

// The writer is notified, and a client without a grant gets no more of the device's data.
TEST_P(SealedLoad, EndsAStreamWithItsGrant) {
  serve(slow_);
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  ASSERT_TRUE(client.begin_stream(kWatch.id, 8));
  ASSERT_TRUE(await([&] { return slow_.has_call.load(); }));
  ASSERT_TRUE(slow_.writer.write(bytes_of("a")));
  ASSERT_TRUE(client.next_item());
  allow("role=command on=other");
  EXPECT_TRUE(await([&] { return !slow_.writer.is_awaited(); }));
  EXPECT_EQ(client.await().kind, Kind::kClosed);
}

TEST_P(SealedLoad, EndsADeferredCallWithItsGrant) {
  serve(slow_);
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  ASSERT_TRUE(client.begin({.method = kLater.id}, bytes_of("a")));
  ASSERT_TRUE(await([&] { return slow_.has_call.load(); }));
  allow("role=observe on=slow");
  EXPECT_EQ(client.await().kind, Kind::kClosed);
  EXPECT_TRUE(await([&] { return !slow_.reply.is_awaited(); }));
  // The reply no longer has a recipient.
  slow_.reply.complete(wire::Status::kOk, 0);
  EXPECT_TRUE(await([&] { return server_->counters().frames.orphaned_count == 1; }));
}

TEST_P(SealedLoad, EndsSessionsOfAThreadPool) {
  ServerConfig config = quiet_config();
  config.lanes[0].static_threads = 3;
  config.lanes[0].buffered_request_max = 8;
  serve(slow_, config);
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  ASSERT_TRUE(client.begin({.method = kLater.id}, bytes_of("a")));
  ASSERT_TRUE(await([&] { return slow_.has_call.load(); }));
  allow("role=observe on=slow");
  EXPECT_EQ(client.await().kind, Kind::kClosed);
}

/// One host (test::OtherHosts) that sends HELLOs with its own valid cookie and a random message 1:
/// each costs the server the first half of a handshake.
class Storm {
 public:
  Storm(std::uint16_t port, std::uint32_t host) : file_(socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_addr.s_addr = htonl(0x0a4d0000U + host);
    is_open_ = bind(file_, reinterpret_cast<sockaddr*>(&own), sizeof own) == 0;
    sockaddr_in server = own;
    server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    server.sin_port = htons(port);
    is_open_ = is_open_ && connect(file_, reinterpret_cast<sockaddr*>(&server), sizeof server) == 0;
    timeval patience{1, 0};
    setsockopt(file_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  }
  Storm(const Storm&) = delete;
  Storm& operator=(const Storm&) = delete;
  ~Storm() { close(file_); }

  /// Gets a cookie; false if there is none.
  [[nodiscard]] bool prove() {
    send(/*has_message=*/false);
    std::array<std::byte, 2048> answer{};
    const ssize_t size = recv(file_, answer.data(), answer.size(), 0);
    if (!is_open_ || size != ssize_t{wire::kHeaderSize + wire::SealedCookie::kSize}) return false;
    const auto cookie =
        wire::decode_sealed_cookie(ConstBytes(answer).subspan(wire::kHeaderSize, 56));
    if (cookie) hello_.cookie = cookie->cookie;
    return cookie.has_value();
  }
  void send(bool has_message) {
    wire::Header header;
    header.kind = wire::FrameKind::kHello;
    header.call_id = ++number_;
    const std::size_t size = has_message ? wire::SealedHello::kSize : wire::Hello::kSize;
    header.payload_size = header.message_size = static_cast<std::uint32_t>(size);
    std::array<std::byte, wire::kHeaderSize + wire::SealedHello::kSize> frame{};
    wire::encode(header, frame.data());
    wire::encode(hello_, MutableBytes(frame).subspan(wire::kHeaderSize));
    frame.back() = static_cast<std::byte>(number_);
    static_cast<void>(::send(file_, frame.data(), wire::kHeaderSize + size, 0));
  }

 private:
  int file_;
  bool is_open_ = false;
  std::uint32_t number_ = 0;
  wire::Hello hello_ = [] {
    wire::Hello hello;
    hello.client_epoch = 77;
    hello.channel = 1;
    hello.message_size_max = 1 << 20;
    hello.features = wire::kFeatureSealed;
    return hello;
  }();
};

// 1000 HELLOs per second, from one address and from many: the existing session makes its calls.
class HelloStorm : public SealedLoad {};
INSTANTIATE_TEST_SUITE_P(Udp, HelloStorm, testing::Values(Transport::kUdp),
                         [](const auto&) { return "Udp"; });

TEST_P(HelloStorm, DoesNotKeepCallsFromRunning) {
  const rtpm::test::OtherHosts hosts;
  if (!hosts.is_there()) GTEST_SKIP() << rtpm::test::OtherHosts::kMissing;
  serve(echo_);
  for (const std::uint32_t host_count : {1u, 50u}) {
    SealedPeer client = peer();
    ASSERT_TRUE(client.open());
    std::vector<std::unique_ptr<Storm>> storms;
    for (std::uint32_t i = 0; i < host_count; ++i) {
      storms.push_back(std::make_unique<Storm>(server_->port(), 0x1000 + host_count + i));
      ASSERT_TRUE(storms.back()->prove());
    }
    const auto dropped_before = server_->counters().frames;
    std::atomic<bool> is_over{false};
    std::thread attacker([&] {
      for (std::size_t i = 0; !is_over; ++i) {
        storms[i % storms.size()]->send(/*has_message=*/true);
        std::this_thread::sleep_for(800us);
      }
    });
    int failure_count = 0;
    const MonotonicTime begin = rt::now();
    while (rt::now() < begin + 1s) {
      if (!client.call(echo::kEcho.id, bytes_of("a"), wire::Delivery::kReply, 5s).is_ok())
        ++failure_count;
    }
    is_over = true;
    attacker.join();
    const auto second_count = static_cast<std::uint64_t>((rt::now() - begin) / 1s) + 1;
    EXPECT_EQ(failure_count, 0);
    const auto dropped = server_->counters().frames;
    const auto reason_count = [&](wire::DropReason reason) {
      return dropped.dropped_for(reason) - dropped_before.dropped_for(reason);
    };
    const std::uint64_t worked_count = reason_count(wire::DropReason::kBadSeal);
    EXPECT_GT(worked_count, 20u);
    EXPECT_LT(worked_count, (host_count == 1 ? 60u : 500u) * second_count);
    if (host_count == 1) {
      EXPECT_GT(reason_count(wire::DropReason::kRateLimited), 0u);
    }
    EXPECT_EQ(dropped.session_evicted_count, 0u);
  }
}

// Forgeries by an attacker on the path: frames of the session with a valid counter, from its own
// address and from another one. RTPM_FORGED_FRAMES sets their number; 1 000 000 take 10 s.
TEST_P(HelloStorm, OfForgedFramesFailsNoCall) {
  const char* const wanted = std::getenv("RTPM_FORGED_FRAMES");
  const std::uint64_t forged_count = wanted == nullptr ? 20'000 : std::stoull(wanted);
  constexpr std::uint64_t kBurst = 50;
  serve(echo_);
  SealedPeer client = peer();
  ASSERT_TRUE(client.open());
  ASSERT_TRUE(client.call(echo::kEcho.id, bytes_of("a")).is_ok());
  auto stranger = transport::open_udp_transport("127.0.0.1", server_->port(), 0);
  ASSERT_TRUE(stranger);
  int failure_count = 0;
  for (std::uint64_t sent = 0; sent < forged_count; sent += kBurst) {
    Bytes forged = client.last_sent();
    for (std::uint64_t i = 0; i < kBurst; ++i) {
      store_le(forged.data() + forged.size() - 24, sent / kBurst + 2 + i);
      store_le(forged.data() + forged.size() - 8, sent + i);
      client.send_raw(forged);
      static_cast<void>((*stranger)->send(forged));
    }
    if (!client.call(echo::kEcho.id, bytes_of("a")).is_ok()) ++failure_count;
  }
  EXPECT_EQ(failure_count, 0);
  const auto frames = server_->counters().frames;
  // The system drops frames that do not fit into the socket's buffer.
  EXPECT_GT(frames.dropped_for(wire::DropReason::kBadSeal), forged_count / 100);
  EXPECT_GT(frames.dropped_for(wire::DropReason::kForeignAddress), forged_count / 100);
}

// HELLOs are not repeated over TCP: the server accepts a handshake, or closes its connection.
TEST_P(SealedLoad, OpensSessionsForManyClientsAtOnce) {
  serve(slow_);
  constexpr int kClientCount = 40;
  std::atomic<int> open_count{0};
  std::vector<std::thread> clients;
  for (int i = 0; i < kClientCount; ++i) {
    clients.emplace_back([&] {
      SealedPeer client = peer();
      if (client.open()) ++open_count;
    });
  }
  for (std::thread& client : clients)
    client.join();
  EXPECT_EQ(open_count, kClientCount);
}

// One connection has at most one handshake at a time, one host at most its share.
TEST_P(SealedLoad, RefusesAHostThatConnectsTooOften) {
  if (GetParam() != Transport::kTcp) GTEST_SKIP() << "HelloStorm has that";
  serve(slow_);
  int refused_count = 0;
  for (int i = 0; i < 3000 && refused_count <= 20; ++i) {
    SealedPeer client(GetParam(), server_->port(), *server_->public_key(),
                      crypto::KeyPair::generate());
    client.begin_open();
    if (client.await(rt::now() + 5ms).kind == Kind::kBroken) ++refused_count;
  }
  EXPECT_GT(refused_count, 20);
}

}  // namespace
}  // namespace rtpm::rpc
