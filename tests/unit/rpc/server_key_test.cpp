#include "rtpm/rpc/server_key.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <atomic>
#include <functional>
#include <thread>

#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/wire/sealed.hpp"

namespace rtpm::rpc {
namespace {

constexpr Duration kPatience = std::chrono::seconds{20};

/// A server that answers each HELLO by what `answer` makes of it.
class Responder {
 public:
  using Bytes = std::vector<std::byte>;
  explicit Responder(std::function<Bytes(ConstBytes hello)> answer) {
    socket_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof own;
    EXPECT_EQ(::bind(socket_, reinterpret_cast<sockaddr*>(&own), size), 0);
    EXPECT_EQ(::getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size), 0);
    port_ = ntohs(own.sin_port);
    thread_ = std::thread([this, answer = std::move(answer)] { serve(answer); });
  }
  Responder(const Responder&) = delete;
  Responder& operator=(const Responder&) = delete;
  ~Responder() {
    ::shutdown(socket_, SHUT_RDWR);
    thread_.join();
    ::close(socket_);
  }
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  void serve(const std::function<Bytes(ConstBytes)>& answer) const {
    while (true) {
      std::array<std::byte, 2048> buffer;
      sockaddr_in from{};
      socklen_t size = sizeof from;
      const ssize_t count = ::recvfrom(socket_, buffer.data(), buffer.size(), 0,
                                       reinterpret_cast<sockaddr*>(&from), &size);
      if (count <= 0) return;
      const Bytes reply = answer(ConstBytes(buffer).first(static_cast<std::size_t>(count)));
      if (reply.empty()) continue;
      ::sendto(socket_, reply.data(), reply.size(), 0, reinterpret_cast<sockaddr*>(&from), size);
    }
  }

  int socket_ = -1;
  std::uint16_t port_ = 0;
  std::thread thread_;
};

std::vector<std::byte> sealed_cookie(ConstBytes hello, unsigned char key,
                                     std::uint32_t number_offset) {
  const auto about = wire::decode_frame(hello);
  const auto read = about ? wire::decode_hello(hello.subspan(wire::kHeaderSize)) : std::nullopt;
  if (!read || (read->features & wire::kFeatureSealed) == 0) return {};
  wire::SealedCookie cookie;
  cookie.server_key.fill(std::byte{key});
  wire::Header header =
      wire::header_about(*about, wire::FrameKind::kCookie, wire::SealedCookie::kSize, rt::now());
  header.call_id += number_offset;
  std::vector<std::byte> frame(wire::kHeaderSize + wire::SealedCookie::kSize);
  wire::encode(header, frame.data());
  wire::encode(cookie, MutableBytes(frame).subspan(wire::kHeaderSize));
  return frame;
}

TEST(ServerKey, IsTheOneInItsCookie) {
  const Responder server([](ConstBytes hello) { return sealed_cookie(hello, 7, 0); });
  const auto key = ask_server_key("127.0.0.1", server.port(), rt::now() + kPatience);
  ASSERT_TRUE(key) << key.error().text();
  EXPECT_EQ(key->front(), std::byte{7});
}

TEST(ServerKey, IsAskedForAgainAndNotTakenFromAnswersToOthers) {
  std::atomic<int> count = 0;
  const Responder server([&](ConstBytes hello) {
    const bool is_other = ++count < 3;
    return is_other ? sealed_cookie(hello, 1, 1) : sealed_cookie(hello, 2, 0);
  });
  const auto key = ask_server_key("127.0.0.1", server.port(), rt::now() + kPatience);
  ASSERT_TRUE(key) << key.error().text();
  EXPECT_EQ(key->front(), std::byte{2});
}

TEST(ServerKey, IsMissedAtAServerWithoutSealedSessions) {
  auto server = Server::create({.lanes = {{}}, .realtime = rt::RealtimeMode::kOff});
  ASSERT_TRUE(server);
  ASSERT_TRUE((*server)->start());
  const auto key = ask_server_key("127.0.0.1", (*server)->port(), rt::now() + kPatience);
  ASSERT_FALSE(key);
  EXPECT_NE(key.error().text().find("has no sealed sessions"), std::string::npos)
      << key.error().text();
}

TEST(ServerKey, IsNotThereWhereNobodyAnswers) {
  const Responder silent([](ConstBytes) { return Responder::Bytes(); });
  auto key = ask_server_key("127.0.0.1", silent.port(), rt::now() + std::chrono::milliseconds{50});
  ASSERT_FALSE(key);
  EXPECT_EQ(key.error().cause, CallError::kUnreachable);
  key = ask_server_key("127.0.0.1", 1, rt::now() + kPatience);
  ASSERT_FALSE(key);
  EXPECT_NE(key.error().text().find("no program has this port"), std::string::npos)
      << key.error().text();
}

}  // namespace
}  // namespace rtpm::rpc
