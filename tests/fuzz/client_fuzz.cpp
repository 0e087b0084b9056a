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

  void begin() {
    if (is_open_) return;
    const MonotonicTime deadline = now_ + std::chrono::milliseconds{50};
    if (!channel_.is_ready()) {
      static_cast<void>(channel_.open(100, deadline, now_));
      ++handshake_;
    } else {
      const auto frame = channel_.call({3, 4, 100, 0, deadline}, {}, now_);
      RTPM_ASSERT(frame.has_value(), "an empty call fits");
      call_id_ = decode_frame(*frame)->call_id;
    }
    is_open_ = true;
  }

  void take(const ChannelEvent& event) {
    switch (event.kind) {
      case ChannelEvent::Kind::kNothing:
        break;
      case ChannelEvent::Kind::kSend:
        RTPM_ASSERT(is_open_ && decode_frame(event.frame).has_value(), "it sends frames");
        break;
      default:
        is_open_ = false;
        break;
    }
    RTPM_ASSERT(!is_open_ || channel_.next_time() != kNever, "what is open has an end");
  }

  void feed(ConstBytes frame) { take(channel_.on_frame(frame, now_)); }

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
      welcome.message_size_max = 1024;
      encode(welcome, MutableBytes(frame).subspan(kHeaderSize));
    }
    const ChannelEvent event = channel_.on_frame(ConstBytes(frame).first(kHeaderSize + size), now_);
    RTPM_ASSERT(event.kind != ChannelEvent::Kind::kReply || (number_offset == 0 && is_open_),
                "only the open call is answered");
    take(event);
  }

  void pass(Duration time) {
    now_ += time;
    take(channel_.on_time(now_));
  }

 private:
  MonotonicTime now_ = time_from_ns(1'000'000'000);
  alignas(16) std::array<std::byte, kHeaderSize + 4096> buffer_{};
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
    switch (step % 4) {
      case 0:
        world.begin();
        break;
      case 1:
        world.feed(script.bytes());
        break;
      case 2:
        world.answer(static_cast<FrameKind>(1 + step / 4 % 7), script.byte() % 3, script.byte(),
                     step >= 128);
        break;
      default:
        world.pass(std::chrono::microseconds{script.number() % 60'000});
        break;
    }
  }
  return 0;
}
