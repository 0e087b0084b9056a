#include "rtpm/rpc/server_key.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>

#include "rtpm/rpc/error.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/wire/sealed.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {
namespace {

constexpr Duration kFirstRepetition = std::chrono::milliseconds{20};
constexpr Duration kRepetitionMax = std::chrono::milliseconds{200};
/// How many port-unreachable answers it takes to believe that the port is closed: one may answer an
/// earlier program's datagram.
constexpr int kRefusalCountMax = 3;

using HelloFrame = std::array<std::byte, wire::kHeaderSize + wire::Hello::kSize>;

HelloFrame hello_of(std::uint32_t number) {
  wire::Hello hello;
  hello.features = wire::kFeatureSealed;
  hello.client_epoch = rt::random_u64();
  hello.channel = 1;
  hello.message_size_max = static_cast<std::uint32_t>(wire::kMessageSizeFloor);
  wire::Header header;
  header.kind = wire::FrameKind::kHello;
  header.call_id = number;
  header.payload_size = header.message_size = wire::Hello::kSize;
  HelloFrame frame{};
  wire::encode(header, frame.data());
  wire::encode(hello, MutableBytes(frame).subspan(wire::kHeaderSize));
  return frame;
}

/// A frame's statement about the server's key: nothing, that there is none, or the key.
enum class Answer : std::uint8_t { kNone, kNoKey, kKey };

Answer answer_of(ConstBytes frame, std::uint32_t number, crypto::PublicKey& key) {
  const auto header = wire::decode_frame(frame);
  if (!header || header->call_id != number) return Answer::kNone;
  // A server without sealed sessions ignores the client's offer.
  if (header->kind == wire::FrameKind::kWelcome) return Answer::kNoKey;
  if (header->kind != wire::FrameKind::kCookie) return Answer::kNone;
  const auto cookie = wire::decode_sealed_cookie(frame.subspan(wire::kHeaderSize));
  if (!cookie) return Answer::kNoKey;
  key = cookie->server_key;
  return Answer::kKey;
}

/// Returns the first answer until the deadline, or until the host refuses the datagram.
Answer await_answer(transport::ClientTransport& server, std::uint32_t number,
                    crypto::PublicKey& key, MonotonicTime until, int& refusal_count) {
  while (rt::now() < until) {
    const auto frame = server.await(until);
    if (!frame && frame.error() == transport::IoError::kRefused && ++refusal_count > 0) {
      if (refusal_count >= kRefusalCountMax) break;
      continue;
    }
    const Answer answer = frame ? answer_of(*frame, number, key) : Answer::kNone;
    if (answer != Answer::kNone) return answer;
  }
  return Answer::kNone;
}

unexpected<SetupError> no_answer(const std::string& where, bool is_refused) {
  SetupError error{"no server answers at UDP " + where,
                   is_refused ? "no program has this port" : "nothing came in time",
                   "start the server, or check host, port and firewall"};
  error.cause = make_error_code(CallError::kUnreachable);
  return unexpected{std::move(error)};
}

}  // namespace

expected<crypto::PublicKey, SetupError> ask_server_key(const std::string& host, std::uint16_t port,
                                                       MonotonicTime deadline) {
  const std::string where = wire::host_and_port(host, port);
  auto server = transport::open_udp_transport(host, port, Priority{0});
  if (!server) return unexpected{server.error()};
  const auto number = static_cast<std::uint32_t>(rt::random_u64());
  const HelloFrame hello = hello_of(number);
  crypto::PublicKey key{};
  Duration repetition = kFirstRepetition;
  int refusal_count = 0;
  while (rt::now() < deadline && refusal_count < kRefusalCountMax) {
    // A lost or refused datagram counts as no answer.
    static_cast<void>((*server)->send(hello));
    const MonotonicTime until = std::min(deadline, rt::now() + repetition);
    switch (await_answer(**server, number, key, until, refusal_count)) {
      case Answer::kKey:
        return key;
      case Answer::kNoKey:
        return setup_error("the server at " + where + " shows no key",
                           "it has no sealed sessions: whoever reaches it is served",
                           "start it with --authorized FILE, or after `rtpm key authorize` there");
      case Answer::kNone:
        break;
    }
    repetition = std::min(2 * repetition, kRepetitionMax);
  }
  return no_answer(where, refusal_count >= kRefusalCountMax);
}

}  // namespace rtpm::rpc
