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
constexpr std::uint32_t kLarge = 8192;

class World {
 public:
  explicit World(Medium medium) : sessions_(config(medium, bulk_)) {}

  void feed(ConstBytes frame, const PeerAddress& peer, std::uint8_t how_it_ends) {
    const Verdict verdict = sessions_.on_frame(frame, peer, now_);
    ConstBytes answer = verdict.frame;
    if (verdict.action == Verdict::Action::kDispatch) {
      const Request& request = verdict.request;
      RTPM_ASSERT(run_.insert({request.header.session, request.header.call_id}).second,
                  "no call runs twice");
      RTPM_ASSERT(request.deadline > now_, "no expired call runs");
      const MutableBytes room = sessions_.reply_buffer(request);
      // At times more than a frame.
      const std::uint32_t wanted = how_it_ends < 128 ? how_it_ends : 30U * how_it_ends;
      const auto size = std::min<std::uint32_t>(wanted, static_cast<std::uint32_t>(room.size()));
      std::ranges::fill(room.first(size), std::byte{how_it_ends});
      answer = sessions_.complete(request, Status::kOk, size, now_);
    }
    for (; !answer.empty(); answer = sessions_.next_frame(now_))
      check_answer(answer, frame, peer);
  }

  void check_answer(ConstBytes answer, ConstBytes frame, const PeerAddress& peer) {
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

  /// One fragment of a call, whose numbers the input chooses.
  void call_in_parts(const PeerAddress& peer, std::uint32_t call_id, std::uint8_t index,
                     std::uint8_t count, std::uint16_t size, std::uint32_t message_size) {
    std::array<std::byte, kHeaderSize + 2048> frame{};
    Header header;
    header.priority = 100;
    header.session = session_of_[peer.port];
    header.call_id = call_id;
    header.budget_us = 1'000'000;
    header.flags = kFlagAckWanted;
    header.fragment_index = index;
    header.fragment_count = count;
    header.payload_size = size % 2048U;
    header.message_size = message_size % 10'000;
    encode(header, frame.data());
    feed(ConstBytes(frame).first(kHeaderSize + header.payload_size), peer, count);
  }

  void acknowledge(const PeerAddress& peer, std::uint32_t call_id, std::uint8_t first_missing,
                   std::uint32_t later) {
    std::array<std::byte, kHeaderSize + FragmentAck::kSize> frame{};
    Header header;
    header.session = session_of_[peer.port];
    header.call_id = call_id;
    encode(ack_header(header, now_), frame.data());
    FragmentAck ack;
    ack.first_missing = first_missing;
    ack.later[0] = later;
    encode(ack, MutableBytes(frame).subspan(kHeaderSize));
    feed(frame, peer, 0);
  }

  void pass(Duration time) { now_ += time; }
  void check() const {
    RTPM_ASSERT(sessions_.session_count() <= kSessionCountMax, "the table keeps its size");
  }

 private:
  static ServerSessionsConfig config(Medium medium, MutableBytes bulk) {
    ServerSessionsConfig config;
    config.message_size_max = kLarge;
    config.bulk_memory = bulk;
    config.medium = medium;
    config.band = {0, 20000};
    config.ceiling = 15000;
    config.epoch = 9;
    config.key = {1, 2};
    config.session_count_max = kSessionCountMax;
    return config;
  }

  MonotonicTime now_ = time_from_ns(1'000'000'000'000);
  std::vector<std::byte> bulk_ = std::vector<std::byte>(3 * kLarge);
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
    switch (step / 3 % 6) {
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
      case 3:
        world.call_in_parts(peer, script.number() % 1000, script.byte(), script.byte(),
                            static_cast<std::uint16_t>(script.number()), script.number());
        break;
      case 4:
        world.acknowledge(peer, script.number() % 1000, script.byte(), script.number());
        break;
      default:
        world.pass(std::chrono::milliseconds{script.number() % 60'000});
        break;
    }
    world.check();
  }
  return 0;
}
