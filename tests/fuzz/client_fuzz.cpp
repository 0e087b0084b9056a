// A client's channel under any frames and times: it takes no answer but its own call's, asks for
// nothing after its deadline, and always has a next time while something is open.

#include <algorithm>
#include <array>
#include <cstdint>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "script.hpp"

using namespace rtpm;
using namespace rtpm::wire;

namespace {

constexpr std::uint64_t kSession = 0x123456789a0000;

class World {
 public:
  explicit World(Medium medium) : channel_({medium, 5, 6, 0, 4096}, buffer_) {}

  void begin(std::size_t size) {
    if (is_open_) return;
    const MonotonicTime deadline = now_ + std::chrono::milliseconds{50};
    if (!channel_.is_ready()) {
      static_cast<void>(channel_.open(100, deadline, now_));
      ++handshake_;
    } else {
      const auto frame =
          channel_.call({3, 4, 100, 0, deadline}, ConstBytes(payload_).first(size), now_);
      RTPM_ASSERT(frame.has_value(), "a call within the limits fits");
      call_id_ = decode_frame(*frame)->call_id;
      for (ConstBytes more; !(more = channel_.next_frame(now_)).empty();) {
        RTPM_ASSERT(decode_frame(more).has_value(), "it sends frames");
      }
    }
    is_open_ = true;
  }

  void take(const ChannelEvent& event) {
    switch (event.kind) {
      case ChannelEvent::Kind::kNothing:
        break;
      case ChannelEvent::Kind::kSend:
        RTPM_ASSERT(is_open_ && decode_frame(event.frame).has_value(), "it sends frames");
        while (!channel_.next_frame(now_).empty()) {
        }
        break;
      default:
        is_open_ = false;
        break;
    }
    RTPM_ASSERT(!is_open_ || channel_.next_time() != kNever, "what is open has an end");
  }

  ChannelEvent receive(ConstBytes frame) {
    ChannelEvent event = channel_.on_frame(frame, now_);
    if (event.kind != ChannelEvent::Kind::kNeedRoom) return event;
    RTPM_ASSERT(is_open_ && event.room_size <= 4096, "room is asked for within the limit");
    channel_.give_room(MutableBytes(room_).first(event.room_size));
    return channel_.on_frame(frame, now_);
  }

  void feed(ConstBytes frame) { take(receive(frame)); }

  void answer(FrameKind kind, std::uint32_t number_offset, std::uint16_t status, bool is_foreign) {
    std::array<std::byte, kHeaderSize + 64> frame{};
    const bool is_handshake = kind == FrameKind::kCookie || kind == FrameKind::kWelcome;
    Header header;
    header.kind = kind;
    header.priority = 100;
    header.session = kSession + (is_foreign ? 1 : 0);
    header.call_id = (is_handshake ? handshake_ : call_id_) + number_offset;
    header.service = 3;
    header.method = 4;
    header.status = static_cast<Status>(status);
    std::size_t size = 0;
    if (kind == FrameKind::kCookie) size = sizeof(Cookie);
    if (kind == FrameKind::kWelcome) size = Welcome::kSize;
    header.payload_size = header.message_size = static_cast<std::uint32_t>(size);
    encode(header, frame.data());
    if (kind == FrameKind::kWelcome) {
      Welcome welcome;
      welcome.band = {0, 200};
      welcome.server_epoch = 1;
      welcome.message_size_max = 4096;
      encode(welcome, MutableBytes(frame).subspan(kHeaderSize));
    }
    const ChannelEvent event = receive(ConstBytes(frame).first(kHeaderSize + size));
    RTPM_ASSERT(event.kind != ChannelEvent::Kind::kReply || (number_offset == 0 && is_open_),
                "only the open call is answered");
    take(event);
  }

  /// A fragment of a reply, or an ACK, whose numbers the input chooses.
  void answer_in_parts(std::uint8_t index, std::uint8_t count, std::uint16_t size,
                       std::uint32_t message_size, bool is_ack) {
    std::array<std::byte, kHeaderSize + 2048> frame{};
    Header header;
    header.kind = is_ack ? FrameKind::kAck : FrameKind::kReply;
    header.priority = 100;
    header.session = kSession;
    header.call_id = call_id_;
    header.service = 3;
    header.method = 4;
    header.flags = kFlagAckWanted;
    header.payload_size = is_ack ? FragmentAck::kSize : size % 2048U;
    header.fragment_index = is_ack ? 0 : index;
    header.fragment_count = is_ack ? 1 : count;
    header.message_size = is_ack ? header.payload_size : message_size % 10'000;
    encode(header, frame.data());
    if (is_ack) {
      FragmentAck ack;
      ack.first_missing = index;
      ack.later[0] = message_size;
      encode(ack, MutableBytes(frame).subspan(kHeaderSize));
    }
    take(receive(ConstBytes(frame).first(kHeaderSize + header.payload_size)));
  }

  void pass(Duration time) {
    now_ += time;
    take(channel_.on_time(now_));
  }

 private:
  MonotonicTime now_ = time_from_ns(1'000'000'000);
  alignas(16) std::array<std::byte, kHeaderSize + 4096> buffer_{};
  std::array<std::byte, 4096> payload_{};
  alignas(16) std::array<std::byte, 4096> room_{};
  ClientChannel channel_;
  bool is_open_ = false;
  std::uint32_t handshake_ = 0;
  std::uint32_t call_id_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Script script(data, size);
  World world(script.byte() % 2 == 0 ? Medium::kDatagram : Medium::kStream);
  while (script.has_more()) {
    const std::uint8_t step = script.byte();
    switch (step % 5) {
      case 0:
        world.begin(script.number() % 4097);
        break;
      case 1:
        world.feed(script.bytes());
        break;
      case 2:
        world.answer(static_cast<FrameKind>(1 + step / 5 % 7), script.byte() % 3, script.byte(),
                     step >= 128);
        break;
      case 4:
        world.answer_in_parts(script.byte(), script.byte(),
                              static_cast<std::uint16_t>(script.number()), script.number(),
                              step >= 128);
        break;
      default:
        world.pass(std::chrono::microseconds{script.number() % 60'000});
        break;
    }
  }
  return 0;
}
