// A client's channel with up to three calls under any frames and times: it accepts only its own
// calls' answers, keeps items in order, requests nothing after its deadlines, and always has a next
// time while a call is open.

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "script.hpp"

using namespace rtpm;
using namespace rtpm::wire;

namespace {

constexpr std::uint64_t kSession = 0x123456789a0000;
constexpr std::uint16_t kCallMax = 3;
constexpr std::uint32_t kLarge = 4096;
constexpr std::uint32_t kItemSize = 96;  // An item that fits in a frame.
constexpr std::uint32_t kByteWindow = 20 * kItemSize;
constexpr std::size_t kItemMemory = (kStreamWindow + 20) * std::size_t{kItemSize};

class World {
 public:
  explicit World(Medium medium) : channel_({medium, 5, 6, 0, kLarge, kCallMax}, buffer_) {}

  void begin(std::size_t size, std::uint8_t how) {
    const MonotonicTime deadline = now_ + std::chrono::milliseconds{how % 4 == 3 ? 5000 : 50};
    if (!channel_.is_ready()) {
      if (is_opening_) return;
      static_cast<void>(channel_.open(100, deadline, now_));
      end_all();
      ++handshake_;
      is_opening_ = true;
      return;
    }
    if (!channel_.has_free_call()) return;
    CallParameters parameters{3, 4, 100, 0, deadline};
    if (how % 4 == 1) parameters.delivery = Delivery::kReceipt;
    if (how % 4 == 2) parameters.delivery = Delivery::kSent;
    if (how % 4 == 3) {
      const auto free = static_cast<std::size_t>(std::ranges::find(open_, false) - open_.begin());
      parameters.stream_window = 1U + how / 4 % kStreamWindow;
      parameters.stream_buffers = {
          .frames = MutableBytes(item_buffers_[free])
                        .first((parameters.stream_window + kByteWindow / kItemSize) * kItemSize),
          .frame_size = kItemSize,
          .item = large_items_[free],
          .byte_window = kByteWindow};
    }
    const auto frame = channel_.call(parameters, ConstBytes(payload_).first(size), now_);
    if (!frame) {
      RTPM_ASSERT(how % 4 == 2 && size > kDatagramPayloadSizeMax, "a call within the limits fits");
      return;
    }
    call_id_ = decode_frame(*frame)->call_id;
    if (how % 4 != 2) {
      const CallIndex index = channel_.last_call();
      RTPM_ASSERT(!open_[index], "a call has its own slot");
      open_[index] = true;
      ended_[index] = false;
    }
    drain();
  }

  void drain() {
    int count = 0;
    for (ConstBytes more; !(more = channel_.next_frame(now_)).empty();) {
      RTPM_ASSERT(decode_frame(more).has_value(), "it sends frames");
      RTPM_ASSERT(++count < 1000, "the queue of frames is finite");
    }
  }

  void take(const ChannelEvent& event) {
    if (!event.frame.empty()) {
      RTPM_ASSERT(decode_frame(event.frame).has_value(), "it sends frames");
    }
    switch (event.kind) {
      case ChannelEvent::Kind::kNothing:
      case ChannelEvent::Kind::kSend:
      case ChannelEvent::Kind::kItems:
        break;
      case ChannelEvent::Kind::kReady:
      case ChannelEvent::Kind::kRefused:
        RTPM_ASSERT(is_opening_, "only a handshake is answered so");
        is_opening_ = false;
        break;
      case ChannelEvent::Kind::kReply:
        RTPM_ASSERT(open_[event.call] && !ended_[event.call], "only an open call is answered");
        ended_[event.call] = channel_.is_open(event.call);
        open_[event.call] = channel_.is_open(event.call);
        break;
      case ChannelEvent::Kind::kTimeout:
        if (is_opening_) {
          is_opening_ = false;
        } else {
          RTPM_ASSERT(open_[event.call], "only an open call times out");
          open_[event.call] = false;
        }
        break;
      default:
        end_all();
        is_opening_ = false;
        break;
    }
    drain();
    check();
  }

  void check() const {
    bool is_waiting = is_opening_;
    for (CallIndex i = 0; i < kCallMax; ++i) {
      RTPM_ASSERT(channel_.is_open(i) == open_[i], "open calls were begun and did not end");
      is_waiting = is_waiting || (open_[i] && !ended_[i]);
    }
    RTPM_ASSERT(!is_waiting || channel_.next_time() != kNever, "an open call has a next time");
  }

  ChannelEvent receive(ConstBytes frame) {
    const ChannelEvent event = channel_.on_frame(frame, now_);
    if (event.kind != ChannelEvent::Kind::kNeedBuffer) return event;
    RTPM_ASSERT(open_[event.call] && event.reply_size <= kLarge,
                "a buffer is requested within the limit");
    channel_.set_reply_buffer(MutableBytes(reply_buffers_[event.call]).first(event.reply_size),
                              event.call);
    return channel_.on_frame(frame, now_);
  }

  void feed(ConstBytes frame) { take(receive(frame)); }

  void answer(FrameKind kind, std::uint32_t number_offset, std::uint16_t status, std::uint32_t item,
              bool is_foreign) {
    std::array<std::byte, kHeaderSize + 256> frame{};
    const bool is_handshake = kind == FrameKind::kCookie || kind == FrameKind::kWelcome;
    Header header;
    header.kind = kind;
    header.priority = 100;
    header.session = kSession + (is_foreign ? 1 : 0);
    header.call_id = is_handshake ? handshake_ + number_offset : call_id_ - number_offset;
    header.service = 3;
    header.method = 4;
    header.status = static_cast<Status>(status);
    if (kind == FrameKind::kReply || kind == FrameKind::kItem) header.item = item;
    std::size_t size = 0;
    if (kind == FrameKind::kCookie) size = sizeof(Cookie);
    if (kind == FrameKind::kWelcome) size = Welcome::kSize;
    if (kind == FrameKind::kItem) size = status % 128U;
    header.payload_size = header.message_size = static_cast<std::uint32_t>(size);
    encode(header, frame.data());
    if (kind == FrameKind::kWelcome) {
      Welcome welcome;
      welcome.band = {0, 200};
      welcome.server_epoch = 1;
      welcome.window = static_cast<std::uint16_t>(1 + status % 9);
      welcome.message_size_max = kLarge;
      encode(welcome, MutableBytes(frame).subspan(kHeaderSize));
    } else if (kind == FrameKind::kItem) {
      std::fill_n(frame.begin() + kHeaderSize, size, static_cast<std::byte>(item));
    }
    take(receive(ConstBytes(frame).first(kHeaderSize + size)));
  }

  /// A fragment of a reply or item, or an ACK, with numbers from the input.
  void answer_in_parts(std::uint8_t index, std::uint8_t count, std::uint16_t size,
                       std::uint32_t message_size, FrameKind kind) {
    std::array<std::byte, kHeaderSize + 2048> frame{};
    const bool is_ack = kind == FrameKind::kAck;
    Header header;
    header.kind = kind;
    if (kind == FrameKind::kItem) header.item = message_size >> 24;
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

  void take_items(CallIndex index, std::uint8_t count) {
    for (std::uint8_t i = 0; i < count; ++i) {
      const auto item = channel_.next_item(index);
      if (!item) break;
      RTPM_ASSERT(open_[index] && item->size() <= kLarge, "items are an open stream's");
    }
    if (ended_[index]) open_[index] = channel_.is_open(index);
    drain();
    check();
  }

  void cancel(CallIndex index) {
    const ConstBytes frame = channel_.cancel(index, now_);
    RTPM_ASSERT(frame.empty() == !open_[index], "what is open is cancelled");
    open_[index] = false;
    check();
  }

  void close() {
    static_cast<void>(channel_.close(now_));
    end_all();
    is_opening_ = false;
    check();
  }

  /// The session is over: only the items of streams that had ended are left.
  void end_all() {
    for (CallIndex i = 0; i < kCallMax; ++i)
      open_[i] = open_[i] && ended_[i];
  }

  void pass(Duration time) {
    now_ += time;
    for (int count = 0;; ++count) {
      const ChannelEvent event = channel_.on_time(now_);
      take(event);
      if (event.kind == ChannelEvent::Kind::kNothing) break;
      RTPM_ASSERT(count < 100, "what is due has an end");
    }
  }

 private:
  MonotonicTime now_ = time_from_ns(1'000'000'000);
  alignas(16) std::array<std::byte, kHeaderSize + kLarge> buffer_{};
  std::array<std::byte, kLarge> payload_{};
  std::array<std::vector<std::byte>, kCallMax> reply_buffers_{std::vector<std::byte>(kLarge),
                                                              std::vector<std::byte>(kLarge),
                                                              std::vector<std::byte>(kLarge)};
  std::array<std::vector<std::byte>, kCallMax> item_buffers_{std::vector<std::byte>(kItemMemory),
                                                             std::vector<std::byte>(kItemMemory),
                                                             std::vector<std::byte>(kItemMemory)};
  std::array<std::vector<std::byte>, kCallMax> large_items_{std::vector<std::byte>(kLarge),
                                                            std::vector<std::byte>(kLarge),
                                                            std::vector<std::byte>(kLarge)};
  ClientChannel channel_;
  bool is_opening_ = false;
  std::array<bool, kCallMax> open_{};
  std::array<bool, kCallMax> ended_{};  ///< Streams whose reply was reported; items may be left.
  std::uint32_t handshake_ = 0;
  std::uint32_t call_id_ = 0;  ///< The id of the latest call.
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Script script(data, size);
  World world(script.byte() % 2 == 0 ? Medium::kDatagram : Medium::kStream);
  while (script.has_more()) {
    const std::uint8_t step = script.byte();
    switch (step % 8) {
      case 0:
        world.begin(script.number() % (kLarge + 1), script.byte());
        break;
      case 1:
        world.feed(script.bytes());
        break;
      case 2:
        world.answer(static_cast<FrameKind>(1 + step / 8 % 11), script.byte() % 4, script.byte(),
                     script.byte(), step >= 240);
        break;
      case 3:
        world.answer_in_parts(script.byte(), script.byte(),
                              static_cast<std::uint16_t>(script.number()), script.number(),
                              step >= 192   ? FrameKind::kItem
                              : step >= 128 ? FrameKind::kAck
                                            : FrameKind::kReply);
        break;
      case 4:
        world.take_items(step / 8 % kCallMax, script.byte());
        break;
      case 5:
        if (step == 253) {
          world.close();
        } else {
          world.cancel(step / 8 % kCallMax);
        }
        break;
      default:
        world.pass(std::chrono::microseconds{script.number() % 600'000});
        break;
    }
  }
  return 0;
}
