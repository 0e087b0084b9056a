// A server's sessions under any frames from three peers on two hosts: raw bytes, and well-formed
// handshakes, calls, streams and cancels with fields from the input; its methods end at once or
// later, in any order. It never sends more to an unproven address than came from it, runs no call
// twice, answers no peer that has gone, and keeps within its tables.

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "script.hpp"

using namespace rtpm;
using namespace rtpm::wire;

namespace {

constexpr std::uint32_t kSessionCountMax = 2;
constexpr std::uint32_t kLarge = 8192;
constexpr std::uint32_t kBufferCount = 2;
constexpr std::size_t kRunningMax = 12;

/// The flags of a CALL that the input chooses.
std::uint16_t flags_of(std::uint8_t choice) {
  return choice % 16;
}

class World {
 public:
  explicit World(Medium medium)
      : stream_memory_(2 * stream_buffer_size(medium)),
        sessions_(config(medium, large_, stream_memory_)) {}

  void feed(ConstBytes frame, const PeerAddress& peer, std::uint8_t how_it_ends) {
    const Verdict verdict = sessions_.on_frame(frame, peer, now_);
    ConstBytes answer = verdict.frame;
    if (verdict.action == Verdict::Action::kDispatch) {
      const Request& request = verdict.request;
      RTPM_ASSERT(run_.insert({request.header.session, request.header.call_id}).second,
                  "no call runs twice");
      RTPM_ASSERT(request.deadline > now_, "no expired call runs");
      if (request.wants_receipt()) {
        send(sessions_.accept(request, static_cast<Status>(how_it_ends % 2), now_), frame, peer);
      }
      if (how_it_ends % 4 == 3 && running_.size() < kRunningMax) {
        sessions_.set_tag(request, ++tag_);
        running_[tag_] = request;
      } else {
        answer = complete(request, how_it_ends);
      }
    }
    RTPM_ASSERT(verdict.credit_tag == 0 || running_.contains(verdict.credit_tag),
                "credit is reported for running calls");
    send(answer, frame, peer);
    take_cancels();
  }

  void send(ConstBytes answer, ConstBytes frame, const PeerAddress& peer) {
    for (; !answer.empty(); answer = sessions_.next_frame(now_))
      check_answer(answer, frame, peer);
  }

  ConstBytes complete(const Request& request, std::uint8_t how_it_ends) {
    const MutableBytes buffer = sessions_.reply_buffer(request, now_);
    // The reply is sometimes larger than a frame.
    const std::uint32_t wanted = how_it_ends < 128 ? how_it_ends : 30U * how_it_ends;
    const auto size = std::min<std::uint32_t>(wanted, static_cast<std::uint32_t>(buffer.size()));
    std::ranges::fill(buffer.first(size), std::byte{how_it_ends});
    const bool is_there = sessions_.peer_of(request).has_value();
    const ConstBytes answer =
        sessions_.complete(request, static_cast<Status>(how_it_ends % kStatusCount),
                           request.wants_stream() ? 0 : size, now_);
    RTPM_ASSERT(is_there || answer.empty(), "a disconnected peer gets no answer");
    const bool is_silent = (request.header.flags & (kFlagNoReply | kFlagReplyOnReceipt)) != 0;
    RTPM_ASSERT(!is_silent || answer.empty(), "a oneway is not answered when it ran");
    return answer;
  }

  /// Lets one of the running calls end, or write an item.
  void continue_call(std::uint8_t which, std::uint8_t how) {
    if (running_.empty()) return;
    const auto one =
        std::next(running_.begin(), static_cast<std::ptrdiff_t>(which % running_.size()));
    const Request request = one->second;
    const auto peer = sessions_.peer_of(request);
    if (how % 2 == 0 && request.wants_stream()) return write_item(one->first, how);
    items_.erase(one->first);
    running_.erase(one);
    send(complete(request, how), {}, peer.value_or(PeerAddress{}));
  }

  /// Writes an item, sometimes a large one, or continues with the current one, as far as it is
  /// accepted.
  void write_item(std::uint32_t tag, std::uint8_t how) {
    const Request request = running_[tag];
    const std::uint32_t size_max = sessions_.item_size_max(request);
    std::vector<std::byte>& item = items_[tag];
    if (!sessions_.is_item_midway(request)) {
      item.assign(std::min<std::uint32_t>(size_max, how < 200 ? how : 40U * how), std::byte{how});
    }
    do {
      const ConstBytes frame = sessions_.push_item(request, item, now_);
      if (frame.empty()) return;
      const auto peer = sessions_.peer_of(request);
      RTPM_ASSERT(size_max > 0 && peer.has_value(), "items have a recipient");
      check_answer(frame, {}, *peer);
    } while (sessions_.is_item_midway(request));
  }

  void take_cancels() {
    for (std::uint32_t tag = sessions_.next_cancelled(); tag != 0;
         tag = sessions_.next_cancelled()) {
      RTPM_ASSERT(running_.contains(tag), "only a running call is cancelled");
      RTPM_ASSERT(sessions_.item_size_max(running_[tag]) == 0, "a cancelled call sends no items");
      RTPM_ASSERT(cancelled_.insert(tag).second, "a cancellation is reported once");
    }
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
            std::uint8_t size, std::uint16_t flags, std::uint32_t item) {
    std::array<std::byte, kHeaderSize + 255> frame{};
    Header header;
    header.priority = 100;
    header.flags = flags;
    header.item = item;
    header.session = session_of_[peer.port];
    header.call_id = call_id;
    header.budget_us = budget_us;
    header.payload_size = header.message_size = size;
    encode(header, frame.data());
    feed(ConstBytes(frame).first(kHeaderSize + size), peer, size);
  }

  /// One fragment of a call, with numbers from the input.
  void call_in_parts(const PeerAddress& peer, std::uint32_t call_id, std::uint8_t index,
                     std::uint8_t count, std::uint16_t size, std::uint32_t message_size) {
    std::array<std::byte, kHeaderSize + 2048> frame{};
    Header header;
    header.priority = 100;
    header.session = session_of_[peer.port];
    header.call_id = call_id;
    // Some calls have no deadline, and may be left unfinished.
    header.budget_us = message_size >= 1U << 31 ? 0xffff'ffff : 1'000'000;
    header.flags = kFlagAckWanted;
    header.fragment_index = index;
    header.fragment_count = count;
    header.payload_size = size % 2048U;
    header.message_size = message_size % 10'000;
    encode(header, frame.data());
    feed(ConstBytes(frame).first(kHeaderSize + header.payload_size), peer, count);
  }

  /// Sends CANCEL, or CLOSE.
  void bare(FrameKind kind, const PeerAddress& peer, std::uint32_t call_id) {
    std::array<std::byte, kHeaderSize> frame{};
    Header header;
    header.kind = kind;
    header.session = session_of_[peer.port];
    header.call_id = kind == FrameKind::kClose ? 0 : call_id;
    encode(header, frame.data());
    feed(frame, peer, 0);
  }

  void credit(const PeerAddress& peer, std::uint32_t call_id, const StreamCredit& credit,
              std::uint32_t limit, bool is_asking) {
    std::array<std::byte, kHeaderSize + StreamCredit::kSize> frame{};
    Header header;
    header.kind = FrameKind::kCredit;
    header.session = session_of_[peer.port];
    header.call_id = call_id;
    header.flags = is_asking ? kFlagAckWanted : std::uint16_t{0};
    header.item = limit;
    header.budget_us = 3'000'000;
    header.payload_size = header.message_size = StreamCredit::kSize;
    encode(header, frame.data());
    encode(credit, MutableBytes(frame).subspan(kHeaderSize));
    feed(frame, peer, 0);
  }

  void close_one() {
    const auto outgoing = sessions_.close_next(now_);
    if (!outgoing) return;
    RTPM_ASSERT(decode_frame(outgoing->frame)->kind == FrameKind::kClose, "it closes");
    take_cancels();
  }

  void acknowledge(const PeerAddress& peer, std::uint32_t call_id, std::uint8_t first_missing,
                   std::uint32_t later, bool is_asking) {
    std::array<std::byte, kHeaderSize + FragmentAck::kSize> frame{};
    Header header;
    header.session = session_of_[peer.port];
    header.call_id = call_id;
    Header ack_frame = header_about(header, FrameKind::kAck, FragmentAck::kSize, now_);
    ack_frame.flags = is_asking ? kFlagAckWanted : std::uint16_t{0};
    encode(ack_frame, frame.data());
    FragmentAck ack;
    ack.first_missing = first_missing;
    ack.later[0] = later;
    encode(ack, MutableBytes(frame).subspan(kHeaderSize));
    feed(frame, peer, 0);
  }

  void pass(Duration time) {
    now_ += time;
    sessions_.on_time(now_);
    RTPM_ASSERT(sessions_.next_time() > now_, "what is due is done");
    take_cancels();
  }
  void check() const {
    RTPM_ASSERT(sessions_.session_count() <= kSessionCountMax, "the table keeps its size");
    RTPM_ASSERT(sessions_.large_message_count(now_) <= kBufferCount,
                "large messages stay within their buffers");
    RTPM_ASSERT(sessions_.large_message_count(now_ + kLargeMessageSilenceMax) <= running_.size(),
                "what is silent is not held");
    RTPM_ASSERT(sessions_.next_buffer_time(now_) > now_, "the next buffer time lies ahead");
  }

 private:
  static ServerSessionsConfig config(Medium medium, MutableBytes large, MutableBytes streams) {
    ServerSessionsConfig config;
    config.stream_memory = streams;
    config.message_size_max = kLarge;
    config.large_memory = large;
    config.medium = medium;
    config.band = {0, 20000};
    config.ceiling = 15000;
    config.epoch = 9;
    config.key = {1, 2};
    config.session_count_max = kSessionCountMax;
    return config;
  }

  MonotonicTime now_ = time_from_ns(1'000'000'000'000);
  std::vector<std::byte> large_ = std::vector<std::byte>((kBufferCount + 1) * kLarge);
  std::vector<std::byte> stream_memory_;
  std::map<std::uint32_t, std::vector<std::byte>> items_;  ///< The current item by tag.
  ServerSessions sessions_;
  std::map<std::uint32_t, std::uint64_t> session_of_;
  std::map<std::uint32_t, Cookie> cookie_of_;
  std::set<std::pair<std::uint64_t, std::uint32_t>> run_;
  std::map<std::uint32_t, Request> running_;  ///< Running calls by tag.
  std::set<std::uint32_t> cancelled_;
  std::uint32_t tag_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Script script(data, size);
  World world(script.byte() % 2 == 0 ? Medium::kDatagram : Medium::kStream);
  while (script.has_more()) {
    const std::uint8_t step = script.byte();
    // Two peers are on one host, and one is on another.
    const PeerAddress peer{0, 1 + step % 3U / 2, step % 3U};
    switch (step / 3 % 10) {
      case 0:
        world.feed(script.bytes(), peer, step);
        break;
      case 1:
        world.hello(peer, script.byte(), script.byte());
        break;
      case 2:
        // A client that wraps around the circle of numbers may meet its own calls again; that takes
        // 2^32 calls, so the input chooses among fewer.
        world.call(peer, script.number() % 1000, script.number(), script.byte(), 0, 0);
        break;
      case 3:
        world.call_in_parts(peer, script.number() % 1000, script.byte(), script.byte(),
                            static_cast<std::uint16_t>(script.number()), script.number());
        break;
      case 4:
        world.acknowledge(peer, script.number() % 1000, script.byte(), script.number(),
                          step >= 128);
        break;
      case 5: {
        const std::uint8_t kind = script.byte();
        const std::uint32_t item = kind < 128 ? 0 : script.byte();
        world.call(peer, script.number() % 1000, 3'000'000, script.byte(), flags_of(kind), item);
        break;
      }
      case 6:
        world.continue_call(script.byte(), script.byte());
        break;
      case 7: {
        const StreamCredit credit{script.number() % 64, script.number(), script.number()};
        world.credit(peer, script.number() % 1000, credit, script.number(), step >= 128);
        break;
      }
      case 8: {
        const std::uint8_t what = script.byte();
        if (what == 255) {
          world.close_one();
        } else {
          world.bare(what >= 240 ? FrameKind::kClose : FrameKind::kCancel, peer,
                     script.number() % 1000);
        }
        break;
      }
      default:
        world.pass(std::chrono::milliseconds{script.number() % 60'000});
        break;
    }
    world.check();
  }
  return 0;
}
