// A client and a server against each other, through a network that the input controls: it loses,
// doubles, delays, reorders and, in some runs, corrupts frames. Without corruption, every call runs
// at most once, its caller gets its own reply or none, a refused call never runs, and items come in
// order without a gap. With corruption, neither side breaks.

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "script.hpp"

using namespace rtpm;
using namespace rtpm::wire;

namespace {

using Frame = std::vector<std::byte>;

constexpr std::uint16_t kCallMax = 4;
constexpr std::uint32_t kLarge = 8192;
constexpr std::size_t kOnTheWayMax = 64;
constexpr PeerAddress kClient{0, 1, 2};

/// Whether `status` promises that the method did not run. A stream may end with expired later.
bool says_not_run(Status status) {
  return status == Status::kOverload || status == Status::kPriorityNotAllowed ||
         status == Status::kWrongBand;
}

class World {
 public:
  World(Medium medium, bool is_corrupting)
      : medium_(medium),
        is_corrupting_(is_corrupting),
        stream_memory_(2 * stream_buffer_size(medium)) {
    restart();
  }

  void open() {
    if (client_.is_ready() || is_opening_) return;
    is_opening_ = true;
    put(to_server_, client_.open(100, now_ + std::chrono::seconds{1}, now_));
  }

  void call(std::uint32_t size, std::uint8_t how) {
    if (!client_.has_free_call()) return open();
    std::size_t slot = 0;
    while (client_.is_open(static_cast<CallIndex>(slot)))
      ++slot;
    Call& call = calls_[slot];
    call = Call{.serial = ++serial_, .payload = Frame(4 + size % (kLarge - 4))};
    store_le(call.payload.data(), call.serial);
    CallParameters parameters{1, 2, 100, 0, now_ + std::chrono::milliseconds{200}};
    if (how % 8 == 1) parameters.delivery = Delivery::kReceipt;
    if (how % 8 == 2) parameters.delivery = Delivery::kSent;
    if (how % 8 >= 5) {
      parameters.deadline = now_ + std::chrono::seconds{20};
      parameters.stream_window = 1U + how / 8;
      const std::uint32_t byte_window = stream_bytes_first(medium_);
      const std::uint32_t count =
          stream_frame_count(medium_, parameters.stream_window, byte_window);
      const auto frame_size =
          static_cast<std::uint32_t>(std::min<std::size_t>(frame_payload_max(medium_), kLarge));
      item_buffers_[slot].resize(count * std::size_t{frame_size});
      large_items_[slot].resize(kLarge);
      parameters.stream_buffers = {.frames = item_buffers_[slot],
                                   .frame_size = frame_size,
                                   .item = large_items_[slot],
                                   .byte_window = byte_window};
    }
    if (how % 8 == 2) call.payload.resize(std::min<std::size_t>(call.payload.size(), 1000));
    const auto frame = client_.call(parameters, call.payload, now_);
    if (!frame) return;
    RTPM_ASSERT(how % 8 == 2 || client_.last_call() == slot, "a call uses the first free slot");
    put(to_server_, *frame);
    send_more();
  }

  void deliver(bool is_to_server, std::uint8_t which) {
    auto& way = is_to_server ? to_server_ : to_client_;
    if (way.empty()) return;
    const std::size_t slot = medium_ == Medium::kStream ? 0 : which % way.size();
    const Frame frame = way[slot];
    way.erase(way.begin() + static_cast<std::ptrdiff_t>(slot));
    if (is_to_server) {
      server_takes(frame);
    } else {
      client_takes(frame);
    }
  }
  void lose(bool is_to_server, std::uint8_t which) {
    auto& way = is_to_server ? to_server_ : to_client_;
    if (medium_ == Medium::kStream || way.empty()) return;
    way.erase(way.begin() + which % static_cast<std::ptrdiff_t>(way.size()));
  }
  void copy(bool is_to_server, std::uint8_t which) {
    auto& way = is_to_server ? to_server_ : to_client_;
    if (medium_ == Medium::kStream || way.empty()) return;
    put(way, Frame(way[which % way.size()]));
  }
  void corrupt(bool is_to_server, std::uint8_t which, std::uint8_t at, std::uint8_t change) {
    auto& way = is_to_server ? to_server_ : to_client_;
    if (!is_corrupting_ || way.empty()) return;
    Frame& frame = way[which % way.size()];
    frame[at % frame.size()] ^= std::byte{change};
  }

  void pass(Duration time) {
    now_ += time;
    for (int count = 0;; ++count) {
      const ChannelEvent event = client_.on_time(now_);
      if (event.kind == ChannelEvent::Kind::kNothing) break;
      take(event);
      RTPM_ASSERT(count < 100, "what is due has an end");
    }
    server_->on_time(now_);
    hear_of_cancels();
  }

  /// Lets one of the running methods end, or write an item.
  void go_on(std::uint8_t which, std::uint32_t size, bool is_item) {
    if (running_.empty()) return;
    const auto one =
        std::next(running_.begin(), static_cast<std::ptrdiff_t>(which % running_.size()));
    const Running running = one->second;
    if (is_item && running.request.wants_stream()) return give_item(one->second);
    // A partly written item has to be completed.
    if (server_->is_item_midway(running.request)) return give_item(one->second);
    running_.erase(one);
    const MutableBytes buffer = server_->reply_buffer(running.request, now_);
    std::uint32_t reply_size =
        std::min<std::uint32_t>(4 + size % kLarge, static_cast<std::uint32_t>(buffer.size()));
    store_le(buffer.data(), running.serial);
    if (running.request.wants_stream()) reply_size = 0;
    server_sends(server_->complete(running.request, Status::kOk, reply_size, now_));
  }

  void take_items(std::size_t slot) {
    const auto index = static_cast<CallIndex>(slot % kCallMax);
    Call& call = calls_[index];
    while (const auto item = client_.next_item(index)) {
      if (!is_corrupting_) {
        RTPM_ASSERT(std::ranges::equal(*item, item_of(call.serial, call.item_count)),
                    "a stream's items come in order, without a gap, and whole");
      }
      ++call.item_count;
    }
    send_more();
  }

  void cancel(std::size_t slot) {
    put(to_server_, client_.cancel(static_cast<CallIndex>(slot % kCallMax), now_));
  }
  void close_client() {
    if (!client_.is_ready()) return;
    put(to_server_, client_.close(now_));
  }
  void close_server() {
    if (const auto outgoing = server_->close_next(now_)) put(to_client_, outgoing->frame);
    hear_of_cancels();
  }
  /// Restarts the server: the running calls are gone.
  void restart() {
    ServerSessionsConfig config;
    config.medium = medium_;
    config.epoch = ++epoch_;
    config.key = {epoch_, 2};
    config.session_count_max = 3;
    config.message_size_max = kLarge;
    config.large_memory = large_;
    config.stream_memory = stream_memory_;
    server_ = std::make_unique<ServerSessions>(config);
    running_.clear();
    if (medium_ == Medium::kDatagram) return;
    to_server_.clear();
    to_client_.clear();
    client_.reset();
    is_opening_ = false;
  }

 private:
  struct Call {
    std::uint32_t serial = 0;
    std::uint32_t item_count = 0;
    Frame payload{};
  };
  struct Running {
    Request request{};
    std::uint32_t serial = 0;
    std::uint32_t item_count = 0;
  };

  void put(std::deque<Frame>& way, ConstBytes frame) {
    if (frame.empty()) return;
    const auto header = decode_frame(frame);
    RTPM_ASSERT(header.has_value() || is_corrupting_, "both sides send frames");
    if (way.size() < kOnTheWayMax || medium_ == Medium::kStream) {
      way.emplace_back(frame.begin(), frame.end());
    }
  }
  void send_more() {
    int count = 0;
    for (ConstBytes frame; !(frame = client_.next_frame(now_)).empty();) {
      put(to_server_, frame);
      RTPM_ASSERT(++count < 1000, "what is to be sent has an end");
    }
  }
  void server_sends(ConstBytes frame) {
    int count = 0;
    for (; !frame.empty(); frame = server_->next_frame(now_)) {
      put(to_client_, frame);
      RTPM_ASSERT(++count < 1000, "what is to be sent has an end");
    }
  }

  void server_takes(const Frame& frame) {
    const Verdict verdict = server_->on_frame(frame, kClient, now_);
    if (verdict.action == Verdict::Action::kDispatch) run(verdict.request);
    server_sends(verdict.frame);
    hear_of_cancels();
  }
  void run(const Request& request) {
    std::uint32_t serial = 0;
    if (request.payload.size() >= 4) serial = load_le<std::uint32_t>(request.payload.data());
    if (!is_corrupting_) {
      RTPM_ASSERT(run_.insert(serial).second, "no call runs twice");
      RTPM_ASSERT(!refused_.contains(serial), "what was refused does not run");
    }
    if (request.wants_receipt()) server_sends(server_->accept(request, Status::kOk, now_));
    server_->set_tag(request, ++tag_);
    running_[tag_] = {request, serial};
  }
  /// Every seventh item is larger than a frame.
  static Frame item_of(std::uint32_t serial, std::uint32_t number) {
    Frame item(number % 7 == 6 ? 4000 + number % 4000 : 8, static_cast<std::byte>(serial));
    store_le(item.data(), serial);
    store_le(item.data() + 4, number);
    return item;
  }
  /// Writes an item, or continues with one, as far as it is accepted.
  void give_item(Running& running) {
    const Frame item = item_of(running.serial, running.item_count);
    bool is_midway = true;
    while (is_midway) {
      const ConstBytes frame = server_->push_item(running.request, item, now_);
      if (frame.empty()) return;
      put(to_client_, frame);
      is_midway = server_->is_item_midway(running.request);
    }
    ++running.item_count;
  }
  void hear_of_cancels() {
    for (std::uint32_t tag = server_->next_cancelled(); tag != 0; tag = server_->next_cancelled()) {
      RTPM_ASSERT(running_.contains(tag), "what is cancelled runs");
    }
  }

  void client_takes(const Frame& frame) {
    ChannelEvent event = client_.on_frame(frame, now_);
    if (event.kind == ChannelEvent::Kind::kNeedBuffer) {
      rooms_[event.call].resize(event.reply_size);
      client_.set_reply_buffer(rooms_[event.call], event.call);
      event = client_.on_frame(frame, now_);
    }
    take(event);
  }
  void take(const ChannelEvent& event) {
    put(to_server_, event.frame);
    switch (event.kind) {
      case ChannelEvent::Kind::kReply:
        if (!is_corrupting_) check_reply(calls_[event.call], event);
        break;
      case ChannelEvent::Kind::kReady:
      case ChannelEvent::Kind::kRefused:
      case ChannelEvent::Kind::kLost:
      case ChannelEvent::Kind::kClosed:
      case ChannelEvent::Kind::kBroken:
        is_opening_ = false;
        break;
      case ChannelEvent::Kind::kTimeout:
        if (!client_.is_ready()) is_opening_ = false;
        break;
      default:
        break;
    }
    send_more();
  }
  void check_reply(const Call& call, const ChannelEvent& event) {
    if (says_not_run(event.status)) {
      RTPM_ASSERT(!run_.contains(call.serial), "what was refused did not run");
      refused_.insert(call.serial);
    }
    if (event.status != Status::kOk) return;
    RTPM_ASSERT(run_.contains(call.serial), "what ended well ran");
    RTPM_ASSERT(
        event.payload.empty() || load_le<std::uint32_t>(event.payload.data()) == call.serial,
        "a call gets its own reply");
  }

  Medium medium_;
  bool is_corrupting_;
  MonotonicTime now_ = time_from_ns(1'000'000'000'000);
  std::uint64_t epoch_ = 0;
  std::vector<std::byte> large_ = std::vector<std::byte>(4 * kLarge);
  std::vector<std::byte> stream_memory_;
  std::array<std::byte, kHeaderSize + kLarge> buffer_{};
  std::array<Frame, kCallMax> rooms_{};
  std::array<Frame, kCallMax> item_buffers_{};
  std::array<Frame, kCallMax> large_items_{};
  std::array<Call, kCallMax> calls_{};
  ClientChannel client_{{medium_, 5, 6, 0, kLarge, kCallMax}, buffer_};
  std::unique_ptr<ServerSessions> server_;
  std::deque<Frame> to_server_;
  std::deque<Frame> to_client_;
  bool is_opening_ = false;
  std::uint32_t serial_ = 0;
  std::uint32_t tag_ = 0;
  std::map<std::uint32_t, Running> running_;
  std::set<std::uint32_t> run_;
  std::set<std::uint32_t> refused_;
};

void do_step(World& world, fuzz::Script& script) {
  const std::uint8_t step = script.byte();
  const bool is_to_server = step >= 128;
  switch (step % 16) {
    case 0:
      return world.open();
    case 1:
    case 2:
      return world.call(script.byte() * (step % 16 == 1 ? 1U : 32U), script.byte());
    case 3:
    case 4:
    case 5:
    case 6:
      return world.deliver(is_to_server, script.byte());
    case 7:
      return world.lose(is_to_server, script.byte());
    case 8:
      return world.copy(is_to_server, script.byte());
    case 9: {
      const std::uint8_t which = script.byte();
      const std::uint8_t at = script.byte();
      return world.corrupt(is_to_server, which, at, script.byte());
    }
    case 10:
      return world.pass(std::chrono::microseconds{script.byte() * 100});
    case 11:
      return world.pass(std::chrono::milliseconds{script.byte() * 16});
    case 12:
    case 13:
      return world.go_on(script.byte(), script.byte() * 40U, step % 16 == 12);
    case 14:
      return world.take_items(step / 16);
    default:
      break;
  }
  switch (script.byte() % 8) {
    case 0:
      return world.close_client();
    case 1:
      return world.close_server();
    case 2:
      return world.restart();
    default:
      return world.cancel(step / 16);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Script script(data, size);
  const std::uint8_t how = script.byte();
  World world(how % 2 == 0 ? Medium::kDatagram : Medium::kStream, how % 4 >= 2);
  while (script.has_more())
    do_step(world, script);
  return 0;
}
