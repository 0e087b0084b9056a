#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "rtpm/test/echo_server.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/medium.hpp"
#include "rtpm/wire/sealed.hpp"

/// The promises of every transport, seen from a caller and a server. A transport takes part by one
/// line in transports_test.cpp.
namespace rtpm::rpc::test {

class TransportSuite : public testing::TestWithParam<Transport> {
 protected:
  void SetUp() override {
    is_network_faulty() = transport() == kFaultyUdp;
    are_sessions_sealed() = is_sealed(transport());
    // Done before a test forks, so that both sides have the same keys.
    if (are_sessions_sealed()) static_cast<void>(sealed_files());
  }
  void TearDown() override { is_network_faulty() = are_sessions_sealed() = false; }
  [[nodiscard]] static Transport transport() { return GetParam(); }
  [[nodiscard]] static bool is_udp() {
    return transport() == Transport::kUdp || transport() == kFaultyUdp || transport() == kSealedUdp;
  }
  [[nodiscard]] static NodeConfig node_config() { return quiet_node(transport()); }
  /// The largest request and reply.
  [[nodiscard]] static std::size_t message_size_max() {
    const std::size_t size = ServerConfig{}.message_size_max;
    // sec-4-3: sealed fragments are smaller.
    return transport() == kSealedUdp ? frame_payload_max() * wire::kFragmentCountMax : size;
  }
  /// The largest payload that fits in one frame.
  [[nodiscard]] static std::size_t frame_payload_max() {
    if (transport() == Transport::kSharedMemory) return wire::kSharedPayloadSizeMax;
    const wire::Medium medium = is_udp() ? wire::Medium::kDatagram : wire::Medium::kStream;
    return is_sealed(transport()) ? wire::sealed_payload_max(medium)
                                  : wire::frame_payload_max(medium);
  }

  /// The error of a call that has to fail.
  static void expect_error(const expected<ReplyLease, CallError>& reply, CallError error) {
    ASSERT_FALSE(reply);
    EXPECT_EQ(reply.error(), error);
  }

  /// The error of a call whose time passes before a servant has it: either the caller notices
  /// first, or the server, if the caller's thread had to wait before it could send.
  static void expect_late(const expected<ReplyLease, CallError>& reply) {
    ASSERT_FALSE(reply);
    EXPECT_TRUE(is_late(reply.error())) << to_string(reply.error());
  }

  /// Waits until `count` calls are inside `hold`.
  static void await_inside(EchoServer& server, int count = 1) {
    ASSERT_TRUE(await([&] { return server.servant.gate().inside_count() == count; }));
  }
};

/// The promises of transports whose network loses nothing: the system reports a server's end, and
/// calls arrive although no caller waits for them yet; a waiting caller would repeat them.
class LosslessSuite : public TransportSuite {};

/// The promises of transports with frames; the tests send frames of their own.
class WireSuite : public TransportSuite {};

}  // namespace rtpm::rpc::test
