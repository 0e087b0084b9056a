#pragma once

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <thread>
#include <utility>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/test/sockets.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/sealed.hpp"

namespace rtpm::test {

/// A socket that answers each datagram with the result of `answer`, unless it is empty.
class HelloResponder {
 public:
  using Bytes = std::vector<std::byte>;
  explicit HelloResponder(std::function<Bytes(ConstBytes hello)> answer) {
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof own;
    EXPECT_EQ(::bind(socket_.number(), reinterpret_cast<sockaddr*>(&own), size), 0);
    EXPECT_EQ(::getsockname(socket_.number(), reinterpret_cast<sockaddr*>(&own), &size), 0);
    port_ = ntohs(own.sin_port);
    thread_ = std::thread([this, answer = std::move(answer)] { serve(answer); });
  }
  HelloResponder(const HelloResponder&) = delete;
  HelloResponder& operator=(const HelloResponder&) = delete;
  ~HelloResponder() {
    is_over_ = true;
    thread_.join();
  }
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  void serve(const std::function<Bytes(ConstBytes)>& answer) const {
    while (!is_over_) {
      std::array<std::byte, 2048> buffer;
      sockaddr_in from{};
      socklen_t size = sizeof from;
      if (!transport::wait_readable(socket_.number(), rt::now() + std::chrono::milliseconds{5})) {
        continue;
      }
      const std::ptrdiff_t count = ::recvfrom(socket_.number(), buffer.data(), buffer.size(), 0,
                                              reinterpret_cast<sockaddr*>(&from), &size);
      if (count <= 0) continue;
      const Bytes reply = answer(ConstBytes(buffer).first(static_cast<std::size_t>(count)));
      if (reply.empty()) continue;
      ::sendto(socket_.number(), reply.data(), reply.size(), 0, reinterpret_cast<sockaddr*>(&from),
               size);
    }
  }

  transport::Descriptor socket_{open_socket(AF_INET, SOCK_DGRAM)};
  std::atomic<bool> is_over_ = false;
  std::uint16_t port_ = 0;
  std::thread thread_;
};

/// A COOKIE that shows a key of 32 equal bytes; empty if the HELLO offers no sealed session.
/// @param number_offset  if not 0, the answer is to another handshake
inline std::vector<std::byte> sealed_cookie(ConstBytes hello, unsigned char key,
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

}  // namespace rtpm::test
