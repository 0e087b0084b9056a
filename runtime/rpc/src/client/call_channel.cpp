#include "client/call_channel.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/wire/sealed.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {
namespace {

// How often a caller that only polls checks whether its peer is gone.
constexpr Duration kCheckInterval = std::chrono::milliseconds{10};

// Otherwise every wait for a server on this host would poll with a timer.
static_assert(wire::kRetransmitIntervalOnHost >
              transport::kBlockTimeShort + transport::kBlockTimeError);
static_assert(wire::kStreamAskIntervalConnected >
              transport::kBlockTime + transport::kBlockTimeError);

wire::Medium medium_of(Transport transport) noexcept {
  return transport == Transport::kUdp ? wire::Medium::kDatagram : wire::Medium::kStream;
}

CallError error_of_refusal(wire::Status status) noexcept {
  switch (status) {
    case wire::Status::kOverload:
      return CallError::kOverload;
    case wire::Status::kVersionUnsupported:
      return CallError::kVersionUnsupported;
    case wire::Status::kNotAllowed:
      return CallError::kNotAllowed;
    default:
      return CallError::kRefused;
  }
}

// The channel is only asked for priorities that it serves.
CallError error_of_begin(wire::Status status) noexcept {
  return status == wire::Status::kTooLarge ? CallError::kTooLarge : CallError::kRefused;
}

// The largest payload of a single frame.
std::size_t payload_size_of(const ServerAddress& address) noexcept {
  if (address.key) return wire::sealed_payload_max(medium_of(address.transport));
  return address.transport == Transport::kSharedMemory
             ? wire::kSharedPayloadSizeMax
             : wire::frame_payload_max(medium_of(address.transport));
}

// The largest frame that the channel sends; at least a HELLO.
std::size_t frame_size_of(const ServerAddress& address, const NodeConfig& config) noexcept {
  return wire::kHeaderSize +
         std::min<std::size_t>(config.message_size_max, payload_size_of(address));
}

}  // namespace

CallChannel::CallChannel(const ServerAddress& address, const NodeConfig& config, NodeKeys& keys,
                         std::uint64_t client_epoch, std::uint64_t number,
                         std::uint64_t clock_domain, std::atomic<std::uint64_t>& lost_oneways)
    : address_(address),
      config_(config),
      keys_(keys),
      buffer_(frame_size_of(address, config)),
      lost_oneways_(lost_oneways),
      wire_({medium_of(address.transport), client_epoch, number, clock_domain,
             config.message_size_max, 1, static_cast<std::uint32_t>(rt::random_u64())},
            buffer_) {}

CallChannel::~CallChannel() {
  // Best effort: the server would notice by itself later.
  if (transport_ && wire_.is_ready()) static_cast<void>(transport_->send(wire_.close(rt::now())));
}

bool CallChannel::serves(Priority priority) const noexcept {
  const std::uint32_t band = band_.load(std::memory_order_relaxed);
  return (band >> 16) <= priority.value() && priority.value() <= (band & 0xffff);
}

void CallChannel::drop_transport() noexcept {
  count_lost_oneways();
  wire_.reset();
  batch_.clear();
  // Freeing counts as set-up here, like opening: it follows a broken connection, not a call.
  const rt::AllowAllocationScope is_allowed;
  transport_.reset();
  sealed_ = nullptr;
}

expected<void, CallError> CallChannel::open_transport(Priority priority,
                                                      MonotonicTime deadline) noexcept {
  const rt::AllowAllocationScope is_allowed;
  const auto failed = [&](SetupError& error) {
    transport_error_ = std::move(error);
    return unexpected{transport::is_shortage(transport_error_.cause.value())
                          ? CallError::kNoResources
                          : CallError::kUnreachable};
  };
  if (address_.key) {
    auto opened = SealedTransport::open(address_, keys_, priority, deadline);
    if (!opened) return failed(opened.error());
    sealed_ = opened->get();
    transport_ = std::move(*opened);
  } else {
    auto opened = open_plain_transport(address_, keys_, priority, deadline);
    if (!opened) return failed(opened.error());
    transport_ = std::move(*opened);
  }
  wire_.set_on_host(transport_->is_on_host());
  if (accepts_batches_) transport_->accept_batches();
  return {};
}

expected<void, CallError> CallChannel::make_ready(Priority priority,
                                                  MonotonicTime deadline) noexcept {
  if (is_ready(priority)) return {};
  transport_error_ = {};
  // If renewing the keys fails, the session continues with the old ones.
  if (is_renewal_due() && !sealed_->renew() && is_ready(priority)) return {};
  if (!transport_) {
    if (auto opened = open_transport(priority, deadline); !opened) return opened;
  }
  return shake_hands(priority, deadline);
}

// Records the reason as text, if known.
unexpected<CallError> CallChannel::refused(CallError error) noexcept {
  const rt::AllowAllocationScope is_allowed;
  if (sealed_ != nullptr) {
    transport_error_ = sealed_->explain();
    if (transport_error_.cause == CallError::kNotAllowed) error = CallError::kNotAllowed;
  } else if (error == CallError::kNotAllowed && is_over_network(address_.transport)) {
    transport_error_ = {"the server asks its callers for keys, and this program does not know it",
                        {},
                        "run: rtpm key learn " + wire::host_and_port(address_.host, address_.port),
                        error};
  }
  return unexpected{error};
}

expected<void, CallError> CallChannel::shake_hands(Priority priority,
                                                   MonotonicTime deadline) noexcept {
  const MonotonicTime begin = rt::now();
  if (!send_all(wire_.open(priority, deadline, begin), begin)) {
    drop_transport();
    return unexpected{CallError::kUnreachable};
  }
  // The server's acceptor may be time-shared and need this CPU.
  const wire::ChannelEvent event = wait_for_event(begin, /*may_spin=*/false, kNever);
  switch (event.kind) {
    case wire::ChannelEvent::Kind::kReady: {
      const Band band = wire_.welcome().band;
      band_.store(std::uint32_t{band.low.value()} << 16 | band.high.value(),
                  std::memory_order_relaxed);
      return {};
    }
    case wire::ChannelEvent::Kind::kRefused:
      return refused(error_of_refusal(event.status));
    case wire::ChannelEvent::Kind::kTimeout: {
      const auto late = refused(CallError::kTimeout);
      // sec-3.2-3: the server may still be busy with the HELLO of this connection.
      if (transport_->medium() == wire::Medium::kStream) drop_transport();
      return late;
    }
    default:
      break;
  }
  const auto error = refused(CallError::kUnreachable);
  drop_transport();
  return error;
}

CallOutcome CallChannel::call(const wire::CallParameters& parameters, ConstBytes request,
                              MonotonicTime now) noexcept {
  if (auto begun = begin(parameters, request, now); !begun) {
    const bool is_unsent = parameters.delivery == wire::Delivery::kSent && !wire_.is_ready();
    return {.kind = is_unsent ? CallOutcome::Kind::kUnsent : CallOutcome::Kind::kFailed,
            .error = begun.error()};
  }
  // An unconfirmed oneway ends once it is sent.
  if (!wire_.is_open(0)) return {.kind = CallOutcome::Kind::kReply};
  return finish(kNever, now);
}

expected<void, CallError> CallChannel::begin(const wire::CallParameters& parameters,
                                             ConstBytes request, MonotonicTime now) noexcept {
  if (parameters.delivery == wire::Delivery::kSent) return begin_sent(parameters, request, now);
  if (parameters.stream_window == 0) return begin_call(parameters, request, now);
  wire::CallParameters stream = parameters;
  if (!make_item_room(stream)) return unexpected{CallError::kTooLarge};
  return begin_call(stream, request, now);
}

// An error means that the oneway was not sent.
expected<void, CallError> CallChannel::begin_sent(wire::CallParameters parameters,
                                                  ConstBytes request, MonotonicTime now) noexcept {
  if (is_look_due(now)) look_for_end(now);
  if (!wire_.is_ready()) return unexpected{CallError::kDisconnected};
  // Only a single frame can be sent unconfirmed. Larger requests are confirmed, which is the
  // stronger guarantee.
  if (request.size() > buffer_.size() - wire::kHeaderSize) {
    parameters.delivery = wire::Delivery::kReceipt;
    return begin_call(parameters, request, now);
  }
  const auto frame = wire_.call(parameters, request, now);
  if (!frame) return unexpected{CallError::kTooLarge};
  const auto sent = transport_->send(*frame);
  if (sent) {
    unconfirmed_count_.fetch_add(1, std::memory_order_relaxed);
    return {};
  }
  // No retransmission follows, so even a full buffer is reported.
  if (transport_->medium() == wire::Medium::kDatagram &&
      sent.error() != transport::IoError::kRefused) {
    const bool is_full = sent.error() != transport::IoError::kFailed;
    return unexpected{is_full ? CallError::kOverload : CallError::kUnreachable};
  }
  // A datagram socket reports in this way that an earlier frame was refused: the server has ended.
  drop_transport();
  return unexpected{CallError::kDisconnected};
}

expected<void, CallError> CallChannel::begin_call(const wire::CallParameters& parameters,
                                                  ConstBytes request, MonotonicTime now) noexcept {
  const auto frame = wire_.call(parameters, request, now);
  if (!frame) return unexpected{error_of_begin(frame.error())};
  if (!send_all(*frame, now)) {
    drop_transport();
    return unexpected{CallError::kDisconnected};
  }
  return {};
}

CallOutcome CallChannel::finish(MonotonicTime until, MonotonicTime now) noexcept {
  const wire::ChannelEvent event = wait_for_event(now, /*may_spin=*/true, until);
  switch (event.kind) {
    case wire::ChannelEvent::Kind::kReply:
      // The server was alive when it answered; over a connection it has received everything sent
      // before.
      unconfirmed_count_.store(0, std::memory_order_relaxed);
      return {CallOutcome::Kind::kReply, {}, event.status, event.payload};
    case wire::ChannelEvent::Kind::kItems:
      return {.kind = CallOutcome::Kind::kItems};
    case wire::ChannelEvent::Kind::kNothing:
      return {.kind = CallOutcome::Kind::kGoing};
    case wire::ChannelEvent::Kind::kLost:
      count_lost_oneways();
      return {.kind = CallOutcome::Kind::kLost, .error = CallError::kDisconnected};
    case wire::ChannelEvent::Kind::kClosed:
      // A connection ends with its server, but a socket may reach the next one.
      count_lost_oneways();
      if (transport_->medium() == wire::Medium::kStream) drop_transport();
      return {.kind = CallOutcome::Kind::kLost, .error = CallError::kStopped};
    case wire::ChannelEvent::Kind::kTimeout:
      return {.error = CallError::kTimeout};
    default:
      break;
  }
  drop_transport();
  const bool is_own_lack = std::exchange(lacks_memory_, false);
  return {.error = is_own_lack ? CallError::kNoResources : CallError::kDisconnected};
}

Readiness CallChannel::announce_sleep() noexcept {
  Readiness at_once{.is_ready = false};
  if (!transport_) return at_once;
  is_asleep_ = true;
  if (!transport_->announce_sleep()) return at_once;
  return {.is_ready = false, .descriptor = transport_->descriptor(), .due = wire_.next_time()};
}

void CallChannel::end_sleep() noexcept {
  if (std::exchange(is_asleep_, false) && transport_) transport_->end_sleep();
}

// A caller that only sends detects the session's end by polling occasionally: sooner if the server
// leaves its frames unread in shared memory.
bool CallChannel::is_look_due(MonotonicTime now) const noexcept {
  constexpr Duration kLookInterval = std::chrono::milliseconds{1};
  constexpr Duration kLookIntervalUnread = std::chrono::microseconds{50};
  const Duration since = now - last_look_;
  return since >= kLookInterval ||
         (since >= kLookIntervalUnread && transport_->unread_count().value_or(0) > 0);
}

void CallChannel::look_for_end(MonotonicTime now) noexcept {
  last_look_ = now;
  transport_->check_peer();
  while (wire_.is_ready()) {
    const auto frame = transport_->receive();
    if (frame) {
      static_cast<void>(wire_.on_frame(*frame, now));
      continue;
    }
    // A refusal means that the port was closed when an earlier frame arrived: that server has
    // ended.
    if (frame.error() != transport::IoError::kNothing) drop_transport();
    break;
  }
  if (!wire_.is_ready()) count_lost_oneways();
}

void CallChannel::check_oneways(MonotonicTime now) noexcept {
  if (transport_ && wire_.is_ready() && has_unconfirmed()) look_for_end(now);
}

// The session has ended.
void CallChannel::count_lost_oneways() noexcept {
  std::uint64_t count = unconfirmed_count_.exchange(0, std::memory_order_relaxed);
  if (count == 0) return;
  const auto unread = transport_ ? transport_->unread_count() : std::nullopt;
  // The last frame that was read may not have been handled.
  if (unread) count = std::min(count, std::uint64_t{*unread} + 1);
  // SYNC POINT lost-oneways
  lost_oneways_.fetch_add(count, std::memory_order_release);
}

std::optional<ConstBytes> CallChannel::next_item() noexcept {
  const auto item = wire_.next_item(0);
  if (const MonotonicTime now = rt::now(); !send_all(wire_.next_frame(now), now)) drop_transport();
  return item;
}

void CallChannel::cancel() noexcept {
  end_sleep();
  const ConstBytes frame = wire_.cancel(0, rt::now());
  // Only saves the server work, so a failure does no harm.
  if (transport_ && !frame.empty()) static_cast<void>(transport_->send(frame));
}

std::optional<ConstBytes> CallChannel::keep(ConstBytes request) {
  constexpr std::size_t kSizeMin = 4096;
  if (kept_.bytes().size() < request.size()) {
    const rt::AllowAllocationScope is_allowed;
    kept_ = rt::LazyMemory(std::bit_ceil(std::max(request.size(), kSizeMin)));
  }
  // The system may be out of memory or of lockable memory.
  if (kept_.bytes().size() < request.size()) return std::nullopt;
  if (!request.empty()) std::memcpy(kept_.bytes().data(), request.data(), request.size());
  return ConstBytes(kept_.bytes()).first(request.size());
}

bool CallChannel::make_item_room(wire::CallParameters& parameters) noexcept {
  const wire::Medium medium = medium_of(address_.transport);
  const std::size_t frame_size = payload_size_of(address_);
  const std::uint32_t byte_window = wire::stream_byte_window(medium, frame_size);
  const std::size_t frames_size =
      frame_size * wire::stream_frame_count(medium, parameters.stream_window, byte_window);
  const std::size_t size = frames_size + config_.message_size_max;
  if (items_.bytes().size() < size) {
    const rt::AllowAllocationScope is_allowed;
    items_ = rt::LazyMemory(size);
  }
  if (items_.bytes().size() < size) return false;
  parameters.stream_buffers = {
      .frames = items_.bytes().first(frames_size),
      .frame_size = static_cast<std::uint32_t>(frame_size),
      .item = items_.bytes().subspan(frames_size, config_.message_size_max),
      .byte_window = byte_window};
  return true;
}

// Sends a frame and any frames that follow it.
bool CallChannel::send_all(ConstBytes frame, MonotonicTime now) noexcept {
  // A datagram of the maximum size is part of a sequence.
  if (address_.transport == Transport::kUdp &&
      frame.size() == wire::kHeaderSize + payload_size_of(address_)) {
    return send_in_batches(frame, now);
  }
  for (; !frame.empty(); frame = wire_.next_frame(now)) {
    if (!send(frame)) return false;
  }
  return true;
}

// Sends a frame and any frames that follow it, many per system call.
bool CallChannel::send_in_batches(ConstBytes frame, MonotonicTime now) noexcept {
  if (!batch_.is_allocated()) {
    const rt::AllowAllocationScope is_allowed;
    batch_ = transport::DatagramBatch::allocate();
  }
  for (; !frame.empty(); frame = wire_.next_frame(now)) {
    if (batch_.add(frame)) continue;
    if (!send_batch()) return false;
    if (!batch_.add(frame) && !send(frame)) return false;
  }
  return send_batch();
}

bool CallChannel::send_batch() noexcept {
  if (batch_.is_empty()) return true;
  const auto sent = send_by([&] { return transport_->send_batch(batch_); });
  batch_.clear();
  return sent.has_value();
}

// Allocates a buffer for a reply larger than a frame. The first of each size is set-up work.
bool CallChannel::make_room(std::uint32_t size) noexcept {
  const rt::AllowAllocationScope is_allowed;
  // Messages larger than a frame arrive in batches.
  if (!std::exchange(accepts_batches_, true)) transport_->accept_batches();
  // Sizes are powers of two, so that growing replies rarely reallocate.
  reply_ = rt::LazyMemory(std::bit_ceil(std::size_t{size}));
  wire_.set_reply_buffer(reply_.bytes());
  return !reply_.bytes().empty();
}

expected<void, transport::IoError> CallChannel::send(ConstBytes frame) noexcept {
  return send_by([&] { return transport_->send(frame); });
}

template <class Send>
expected<void, transport::IoError> CallChannel::send_by(Send send) noexcept {
  auto sent = send();
  // A datagram socket reports at the next send that an earlier frame was refused, and does not send
  // this one. If the server is still gone, the next receive reports it.
  if (!sent && sent.error() == transport::IoError::kRefused) sent = send();
  // A datagram that does not fit the buffer counts as lost: it is retransmitted.
  if (!sent && transport_->medium() == wire::Medium::kDatagram) return {};
  return sent;
}

// Waits for the outcome of the handshake or call, at most until `until`. Returns kNothing after
// that, and kBroken if the transport is.
wire::ChannelEvent CallChannel::wait_for_event(MonotonicTime now, bool may_spin,
                                               MonotonicTime until) noexcept {
  wire::ChannelEvent event{.kind = wire::ChannelEvent::Kind::kBroken};
  // Sending a stream's acknowledgement may have found the connection broken.
  if (!transport_) return event;
  may_spin =
      may_spin &&
      (config_.wait.strategy == rt::WaitStrategy::kSpin ||
       (config_.wait.strategy != rt::WaitStrategy::kBlock && config_.wait.spin > Duration{0}));
  const MonotonicTime spin_end =
      config_.wait.strategy == rt::WaitStrategy::kSpin ? kNever : now + config_.wait.spin;
  int refusal_count = 0;
  // A caller that keeps a CPU busy at a real-time priority blocks occasionally, so that the kernel
  // does not throttle it.
  rt::RealtimeBudget& budget = rt::this_thread_budget();
  bool is_spinning = may_spin && !budget.must_pause(now);
  const auto wake_time = [&] {
    const MonotonicTime wake = std::min(until, wire_.next_time());
    return may_spin && now < spin_end ? std::min(wake, now + rt::RealtimeBudget::kPause) : wake;
  };
  // A transport notices some events, such as its server's end, only while waiting, so a polling
  // caller waits occasionally.
  if (now >= until && now - last_check_ >= kCheckInterval) {
    last_check_ = now;
    transport_->wait(until);
  }
  while (true) {
    const bool may_block = !is_spinning && now < until;
    const bool must_sleep = may_block && budget.must_sleep(now);
    if (must_sleep) rt::sleep_until(now + rt::RealtimeBudget::kPause);
    auto frame = may_block && !must_sleep ? transport_->await(wake_time()) : transport_->receive();
    if (!frame && frame.error() == transport::IoError::kRefused) {
      // The system reports a refusal before frames that arrived earlier, such as the CLOSE of a
      // server that stopped.
      if (auto earlier = transport_->receive()) frame = earlier;
    }
    now = rt::now();
    if (frame) {
      take(*frame, now, event);
    } else if (frame.error() == transport::IoError::kNothing) {
      set(event, [&] { return wire_.on_time(now); });
      is_spinning = may_spin && now < spin_end && !budget.must_pause(now);
    } else if (frame.error() == transport::IoError::kRefused && ++refusal_count == 1 &&
               wire_.is_ready()) {
      // The refusal may answer a frame sent before the server was back: retry once.
      set(event, [&] { return wire_.repeat_first(now); });
    } else {
      event = {.kind = wire::ChannelEvent::Kind::kBroken};
    }
    if (event.kind == wire::ChannelEvent::Kind::kBroken) return event;
    // The last ACK of a received reply may fail: the server drops the reply by itself later.
    const bool is_sent = send_all(event.frame, now);
    if (event.kind == wire::ChannelEvent::Kind::kSend) {
      if (!is_sent) {
        event.kind = wire::ChannelEvent::Kind::kBroken;
        return event;
      }
    } else if (event.kind != wire::ChannelEvent::Kind::kNothing || now >= until) {
      return event;
    }
  }
}

void CallChannel::take(ConstBytes frame, MonotonicTime now, wire::ChannelEvent& event) noexcept {
  set(event, [&] { return wire_.on_frame(frame, now); });
  if (event.kind == wire::ChannelEvent::Kind::kNeedBuffer) {
    if (!make_room(event.reply_size)) {
      lacks_memory_ = true;
      event = {.kind = wire::ChannelEvent::Kind::kBroken};
      return;
    }
    set(event, [&] { return wire_.on_frame(frame, now); });
  }
  // Foreign frames may arrive endlessly; the deadline still applies.
  if (event.kind == wire::ChannelEvent::Kind::kNothing) {
    set(event, [&] { return wire_.on_time(now); });
  }
}

}  // namespace rtpm::rpc
