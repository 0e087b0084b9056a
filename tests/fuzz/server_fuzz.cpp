// A server's sessions under any frames from three peers: raw bytes, and well-formed handshakes and
// calls whose fields the input chooses. It never sends more to an unproven address than came from
// it, runs no call twice, and keeps within its tables.

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "script.hpp"

using namespace rtpm;
using namespace rtpm::wire;

namespace {

constexpr std::uint32_t kSessionCountMax = 2;

class World {
 public:
  explicit World(Medium medium) : sessions_(config(medium)) {}

  void feed(ConstBytes frame, const PeerAddress& peer, std::uint8_t how_it_ends) {
    const Verdict verdict = sessions_.on_frame(frame, peer, now_);
    ConstBytes answer = verdict.frame;
    if (verdict.action == Verdict::Action::kDispatch) {
      const Request& request = verdict.request;
      RTPM_ASSERT(run_.insert({request.header.session, request.header.call_id}).second,
                  "no call runs twice");
      RTPM_ASSERT(request.deadline > now_, "no expired call runs");
      const MutableBytes room = sessions_.reply_buffer(request);
      const auto size =
          std::min<std::uint32_t>(how_it_ends, static_cast<std::uint32_t>(room.size()));
      std::ranges::fill(room.first(size), std::byte{how_it_ends});
      answer = sessions_.complete(request, Status::kOk, size, now_);
    }
    if (answer.empty()) return;
    const auto header = decode_frame(answer);
    RTPM_ASSERT(header.has_value(), "what the server sends is a frame");
    if (header->kind == FrameKind::kWelcome) session_of_[peer.port] = header->session;
    if (header->kind == FrameKind::kCookie) {
      std::ranges::copy(answer.subspan(kHeaderSize), cookie_of_[peer.port].begin());
    }
    const bool is_unproven =
        header->kind == FrameKind::kCookie || header->kind == FrameKind::kRefuse;
    RTPM_ASSERT(!is_unproven || answer.size() <= frame.size(), "nothing is amplified");
  }

  void hello(const PeerAddress& peer, std::uint32_t handshake, std::uint8_t channel) {
    std::array<std::byte, kHeaderSize + Hello::kSize> frame{};
    Header header;
    header.kind = FrameKind::kHello;
    header.priority = 100;
    header.call_id = handshake;
    header.payload_size = header.message_size = Hello::kSize;
    encode(header, frame.data());
    Hello hello;
    hello.client_epoch = 7;
    hello.channel = channel;
    hello.message_size_max = 4096;
    hello.cookie = cookie_of_[peer.port];
    encode(hello, MutableBytes(frame).subspan(kHeaderSize));
    feed(frame, peer, 0);
  }

  void call(const PeerAddress& peer, std::uint32_t call_id, std::uint32_t budget_us,
            std::uint8_t size) {
    std::array<std::byte, kHeaderSize + 255> frame{};
    Header header;
    header.priority = 100;
    header.session = session_of_[peer.port];
    header.call_id = call_id;
    header.budget_us = budget_us;
    header.payload_size = header.message_size = size;
    encode(header, frame.data());
    feed(ConstBytes(frame).first(kHeaderSize + size), peer, size);
  }

  void pass(Duration time) { now_ += time; }
  void check() const {
    RTPM_ASSERT(sessions_.session_count() <= kSessionCountMax, "the table keeps its size");
  }

 private:
  static ServerSessionsConfig config(Medium medium) {
    ServerSessionsConfig config;
    config.medium = medium;
    config.band = {0, 20000};
    config.ceiling = 15000;
    config.epoch = 9;
    config.key = {1, 2};
    config.session_count_max = kSessionCountMax;
    return config;
  }

  MonotonicTime now_ = time_from_ns(1'000'000'000'000);
  ServerSessions sessions_;
  std::map<std::uint32_t, std::uint64_t> session_of_;
  std::map<std::uint32_t, Cookie> cookie_of_;
  std::set<std::pair<std::uint64_t, std::uint32_t>> run_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Script script(data, size);
  World world(script.byte() % 2 == 0 ? Medium::kDatagram : Medium::kStream);
  while (script.has_more()) {
    const std::uint8_t step = script.byte();
    const PeerAddress peer{0, 1, step % 3U};
    switch (step / 3 % 4) {
      case 0:
        world.feed(script.bytes(), peer, step);
        break;
      case 1:
        world.hello(peer, script.byte(), script.byte());
        break;
      case 2:
        // A client that runs once around the circle of numbers may meet its own calls again; that
        // takes 2^32 calls, so the input chooses among fewer.
        world.call(peer, script.number() % 1000, script.number(), script.byte());
        break;
      default:
        world.pass(std::chrono::milliseconds{script.number() % 60'000});
        break;
    }
    world.check();
  }
  return 0;
}
