#include "security/sealed_transport.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/access/fingerprint.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {
namespace {

using transport::IoError;

/// When a failed handshake for new keys is retried.
constexpr Duration kRenewalInterval = std::chrono::seconds{1};
/// How long a call may have to wait for new keys.
constexpr Duration kRenewalPatience = std::chrono::milliseconds{100};
/// When waiting for new keys is retried after it failed.
constexpr Duration kRenewalPause = std::chrono::seconds{10};
/// A caller that is rarely there to receive the answers gets no new keys in the background.
constexpr Duration kOverdue = std::chrono::seconds{10};
/// How long frames may still arrive over a connection whose session has moved to another.
constexpr Duration kFormerMax = std::chrono::seconds{1};

void hear_keys(void* context, std::uint64_t session, const crypto::SessionKeys& keys) {
  static_cast<NodeKeys*>(context)->log(session, keys);
}

}  // namespace

expected<std::unique_ptr<transport::ClientTransport>, SetupError> open_plain_transport(
    const ServerAddress& address, NodeKeys& keys, Priority priority, MonotonicTime deadline) {
  switch (address.transport) {
    case Transport::kTcp:
      return transport::open_tcp_transport(address.host, address.port, priority,
                                           wire::kStreamPayloadSizeMax, deadline);
    case Transport::kSharedMemory:
      return transport::open_shared_memory_transport(
          {address.host, address.port, address.memory_folder, keys.trusted_users()}, priority,
          deadline);
    case Transport::kUdp:
    case Transport::kAuto:
    case Transport::kLocal:
      break;
  }
  return transport::open_udp_transport(address.host, address.port, priority);
}

expected<std::unique_ptr<SealedTransport>, SetupError> SealedTransport::open(
    const ServerAddress& address, NodeKeys& keys, Priority priority, MonotonicTime deadline) {
  auto own = keys.own();
  if (!own) return unexpected{own.error()};
  auto within = open_plain_transport(address, keys, priority, deadline);
  if (!within) return unexpected{within.error()};
  sealed::SealedClientConfig config;
  config.medium = (*within)->medium();
  config.own = &**(*own);
  config.server = *address.key;
  config.handshake_number = static_cast<std::uint32_t>(rt::random_u64());
  config.limits = keys.limits;
  config.renewal_interval = keys.renewal_interval;
  if (keys.has_log()) config.key_listener = {&hear_keys, &keys};
  auto client = Secret<sealed::SealedClient>::make(config);
  if (!client) return unexpected{client.error()};
  return std::unique_ptr<SealedTransport>(new SealedTransport(
      address, keys, std::move(*within), std::move(*own), std::move(*client), priority));
}

SealedTransport::SealedTransport(const ServerAddress& address, NodeKeys& keys,
                                 std::unique_ptr<transport::ClientTransport> within,
                                 std::shared_ptr<const OwnKey> own,
                                 Secret<sealed::SealedClient> client, Priority priority) noexcept
    : address_(address),
      keys_(keys),
      within_(std::move(within)),
      own_(std::move(own)),
      client_(std::move(client)),
      priority_(priority) {}

// Sends a step's frames, keeps its frames for the channel, and does the work that follows.
expected<void, IoError> SealedTransport::perform(sealed::SealedClient::Step step,
                                                 transport::ClientTransport& over,
                                                 MonotonicTime now) noexcept {
  while (true) {
    if (!step.deliver.empty()) keep(step.deliver);
    if (!step.send.empty()) {
      if (auto sent = over.send(step.send); !sent) return sent;
    }
    if (!client().has_work()) return {};
    step = client().work(now);
  }
}

// A frame that does not fit counts as lost.
void SealedTransport::keep(ConstBytes frame) noexcept {
  if (kept_count_ == kKeptMax || frame.size() > kKeptSizeMax) return;
  const std::size_t at = (kept_first_ + kept_count_++) % kKeptMax;
  std::ranges::copy(frame, kept_[at].begin());
  kept_sizes_[at] = frame.size();
}

MutableBytes SealedTransport::take_kept() noexcept {
  taken_ = kept_[kept_first_];
  const std::size_t size = kept_sizes_[kept_first_];
  kept_first_ = (kept_first_ + 1) % kKeptMax;
  --kept_count_;
  return MutableBytes(taken_).first(size);
}

expected<void, IoError> SealedTransport::send(ConstBytes frame) noexcept {
  if (!is_here()) return unexpected{IoError::kFailed};
  const MonotonicTime now = rt::now();
  const bool had_next = client().has_next(now);
  const sealed::SealedClient::Step step = client().send(frame, now);
  if (had_next && !client().has_next(now)) move(now);
  auto sent = perform(step, *within_, now);
  if (sent) look_at_keys(now);
  return sent;
}

expected<void, IoError> SealedTransport::send_batch(
    const transport::DatagramBatch& batch) noexcept {
  if (!is_here()) return unexpected{IoError::kFailed};
  if (!batch_.is_allocated()) {
    const rt::AllowAllocationScope is_allowed;
    batch_ = transport::DatagramBatch::allocate();
  }
  const MonotonicTime now = rt::now();
  expected<void, IoError> sent;
  const auto flush = [&] {
    if (sent && !batch_.is_empty()) sent = within_->send_batch(batch_);
    batch_.clear();
  };
  const bool is_whole = batch.for_each([&](ConstBytes frame) {
    const sealed::SealedClient::Step step = client().send(frame, now);
    if (!step.deliver.empty()) keep(step.deliver);
    if (step.send.empty() || batch_.add(step.send)) return true;
    flush();
    if (!batch_.add(step.send) && sent) sent = within_->send(step.send);
    return sent.has_value();
  });
  if (is_whole) flush();
  batch_.clear();
  if (sent) look_at_keys(now);
  return sent;
}

// sec-6-5: renews the keys before the old ones expire. Over datagrams the handshake runs beside the
// calls; their receives take its answers.
void SealedTransport::look_at_keys(MonotonicTime now) noexcept {
  if (former_ && now >= former_until_) {
    const rt::AllowAllocationScope is_allowed;
    former_.reset();
  }
  wants_renewal_ = client().has_next(now);
  if (wants_renewal_) return;
  if (!client().is_renewal_due(now)) {
    due_since_ = kNever;
    return;
  }
  if (due_since_ == kNever) due_since_ = now;
  const bool is_late = client().is_renewal_urgent() || now - due_since_ >= kOverdue;
  // A failed attempt in the background does not delay an urgent one.
  if (now < (is_late ? next_wait_ : next_renewal_)) return;
  if (medium() == wire::Medium::kStream || is_late) {
    wants_renewal_ = true;
    return;
  }
  next_renewal_ = now + kRenewalInterval;
  static_cast<void>(perform(client().renew(now), *within_, now));
}

// The channel has moved to the next session.
void SealedTransport::move(MonotonicTime now) noexcept {
  due_since_ = kNever;
  next_renewal_ = next_wait_ = {};
  if (!next_within_) return;
  const rt::AllowAllocationScope is_allowed;
  former_ = std::exchange(within_, std::move(next_within_));
  former_until_ = now + kFormerMax;
}

bool SealedTransport::renew() noexcept {
  wants_renewal_ = false;
  if (!is_here()) return false;
  if (client().has_next(rt::now())) return true;
  const rt::AllowAllocationScope is_allowed;
  const bool is_renewed = renew_now();
  if (!is_renewed) {
    next_within_.reset();
    next_renewal_ = next_wait_ = rt::now() + kRenewalPause;
  }
  return is_renewed;
}

bool SealedTransport::renew_now() noexcept {
  MonotonicTime now = rt::now();
  const MonotonicTime deadline = now + kRenewalPatience;
  if (medium() == wire::Medium::kStream) {
    auto opened = open_plain_transport(address_, keys_, priority_, deadline);
    if (!opened) return false;
    next_within_ = std::move(*opened);
  }
  transport::ClientTransport& over = next_within_ ? *next_within_ : *within_;
  if (!perform(client().renew(now), over, now)) return false;
  while (!client().has_next(now) && now < deadline) {
    const auto frame = over.await(deadline);
    now = rt::now();
    if (!frame && frame.error() != IoError::kNothing) return false;
    if (!frame) continue;
    const sealed::SealedClient::Step step = client().receive(*frame, now);
    if (step.is_broken || !perform(step, over, now)) return false;
  }
  return client().has_next(now);
}

expected<MutableBytes, IoError> SealedTransport::open_frame(
    expected<MutableBytes, IoError> frame) noexcept {
  if (!frame) return frame;
  const MonotonicTime now = rt::now();
  sealed::SealedClient::Step step = client().receive(*frame, now);
  if (step.is_broken) return unexpected{IoError::kBroken};
  // The opened frame is not copied.
  const ConstBytes opened = std::exchange(step.deliver, {});
  static_cast<void>(perform(step, *within_, now));
  if (!opened.empty() && opened.data() == frame->data()) return frame->first(opened.size());
  if (!opened.empty()) keep(opened);
  if (kept_count_ > 0) return take_kept();
  return unexpected{IoError::kNothing};
}

expected<MutableBytes, IoError> SealedTransport::receive() noexcept {
  // A child process would receive its parent's frames.
  if (!is_here()) return unexpected{IoError::kFailed};
  if (kept_count_ > 0) return take_kept();
  if (client().has_ended()) return unexpected{IoError::kBroken};
  return open_frame(within_->receive());
}

void SealedTransport::wait(MonotonicTime until) noexcept {
  if (kept_count_ == 0) within_->wait(until);
}

expected<MutableBytes, IoError> SealedTransport::await(MonotonicTime until) noexcept {
  if (!is_here()) return unexpected{IoError::kFailed};
  if (kept_count_ > 0) return take_kept();
  if (client().has_ended()) return unexpected{IoError::kBroken};
  return open_frame(within_->await(until));
}

SetupError SealedTransport::explain() const {
  if (!is_here()) return {};
  const std::string where = wire::host_and_port(address_.host, address_.port);
  const std::string server = "the server at " + where;
  const access::KnownServer known = keys_.entry_of(*address_.key);
  const std::string line = "line " + std::to_string(known.line) + " of known_servers";
  if (const auto& other = client().other_key()) {
    const std::string host = wire::host_in_url(known.host);
    return {server + " shows another key than " + line,
            access::fingerprint(*other) + " instead of " + access::fingerprint(known.key),
            "compare it with `rtpm key show` at the server; if it is the same: rtpm key forget " +
                host + ", then rtpm key learn " + where + (known.port == 0 ? "" : " --port-only") +
                "; else somebody is in between",
            {}};
  }
  if (client().hint() == wire::Status::kNotAllowed) {
    return {server + " does not admit this program's key, it seems",
            {},
            "have its owner run: rtpm key authorize '" +
                access::public_key_text((*own_)->public_key) + "' --role command --on '**'",
            CallError::kNotAllowed};
  }
  if (client().hint() == wire::Status::kVersionUnsupported) {
    return {server + " has no sealed sessions, it seems",
            line + " has its key, so it is not called in plain",
            "start it with grants (--authorized), or remove the line",
            {}};
  }
  if (medium() == wire::Medium::kDatagram || client().has_session()) return {};
  return {server + " opens no sealed session",
          "it has no sealed sessions, or another key than " + line,
          "compare the key that it shows at its start with the line",
          {}};
}

}  // namespace rtpm::rpc
