#include "rtpm/sealed/client.hpp"

#include <algorithm>

#include "rtpm/base/assert.hpp"

namespace rtpm::sealed {
namespace {

using namespace std::chrono_literals;
using wire::DropReason;
using wire::FrameKind;

/// At most one handshake per interval is started because of hints (sec-6-2). The interval doubles
/// with each handshake without a result.
constexpr Duration kProbeIntervalMin = 100ms;
constexpr Duration kProbeIntervalMax = 1s;
/// How long a new session waits for the channel; the server keeps half-open ones longer.
constexpr Duration kNextMax = 1s;

constexpr std::size_t kAtFeatures = wire::kHeaderSize + 4;
constexpr std::size_t kAtCallId = 16;
constexpr std::size_t kAtCookie = wire::kHeaderSize + 40;

ConstBytes hello_payload(ConstBytes frame) noexcept {
  return frame.subspan(wire::kHeaderSize, wire::Hello::kSize);
}

}  // namespace

SealedClient::SealedClient(const SealedClientConfig& config)
    : config_(config),
      number_(config.handshake_number),
      sealed_frame_(wire::kHeaderSize + wire::frame_payload_max(config.medium)) {
  RTPM_ASSERT(config.own != nullptr, "a client that seals has a key");
}

SealedClient::Step SealedClient::drop(DropReason reason) noexcept {
  counters_.drop(reason);
  return {};
}

void SealedClient::end(Session& session) noexcept {
  session.seal.reset();
  session.id = 0;
}

void SealedClient::reset() noexcept {
  for (Session& session : sessions_)
    end(session);
  gone_session_ = 0;
  is_opening_ = is_message_1_due_ = is_message_2_due_ = false;
  initiator_.reset();
}

bool SealedClient::is_past(std::uint64_t part, std::uint64_t of) const noexcept {
  if (!current().seal) return false;
  const crypto::SealedSession& session = *current().seal;
  return session.send_counter() >= config_.limits.counter_end / of * part ||
         session.forged_count() >= config_.limits.forged_max / of * part;
}

bool SealedClient::is_renewal_due(MonotonicTime now) const noexcept {
  return is_past(3, 4) || (current().seal && now - current().opened >= config_.renewal_interval);
}

// sec-6-5
SealedClient::Step SealedClient::renew(MonotonicTime now) noexcept {
  if (!current().seal || has_next(now)) return {};
  if (is_opening_ && purpose_ != Purpose::kRenewal) return {};
  begin_handshake(Purpose::kRenewal);
  store_le(hello_.data() + kAtCallId, number_);
  if (config_.medium == wire::Medium::kDatagram) return {.send = first_hello()};
  suite_ = crypto::best_suite(config_.suites, config_.suites);
  static_cast<void>(begin_message_1());
  return {};
}

SealedClient::Step SealedClient::send(ConstBytes frame, MonotonicTime now) noexcept {
  const auto header = wire::decode(frame);
  RTPM_ASSERT(header, "a channel gives frames");
  if (header->kind == FrameKind::kHello) return send_hello(*header, frame, now);
  // The server reported this session as gone; the channel learns this call by call.
  const bool asks = header->kind == FrameKind::kCall || header->kind == FrameKind::kCredit;
  if (asks && gone_session_ != 0 && header->session == gone_session_) return tell_lost(*header);
  // No frame of a session is sent unsealed: without keys it counts as lost.
  if (!is_current(header->session)) return {};
  RTPM_ASSERT(frame.size() + crypto::kTrailerSize <= sealed_frame_.size(),
              "a channel's frames leave space for the seal");
  const MutableBytes out = MutableBytes(sealed_frame_).first(frame.size() + crypto::kTrailerSize);
  std::ranges::copy(frame.first(wire::kHeaderSize), out.begin());
  wire::mark_sealed(out.data());
  const bool is_sealed =
      current()
          .seal->seal(out.first(wire::kHeaderSize), frame.subspan(wire::kHeaderSize), out)
          .has_value();
  if (header->kind == FrameKind::kClose) {
    end(current());
  }
  if (!is_sealed) return {};
  return {.send = out};
}

// ---- handshakes: sending ------------------------------------------------------------------------

void SealedClient::begin_handshake(Purpose purpose) noexcept {
  is_opening_ = true;
  purpose_ = purpose;
  end(next());
  is_message_1_due_ = is_message_2_due_ = has_cookie_ = has_sealed_hello_ = false;
  initiator_.reset();
  ++number_;
  hint_.reset();
}

// The channel's HELLO as sent to the server: with this client's number and features.
void SealedClient::write_hello(ConstBytes frame, std::uint32_t features) noexcept {
  std::ranges::copy(frame, hello_.begin());
  store_le(hello_.data() + kAtCallId, number_);
  store_le(hello_.data() + kAtFeatures, features);
}

ConstBytes SealedClient::first_hello() noexcept {
  std::ranges::fill(MutableBytes(hello_).subspan(kAtCookie, sizeof(wire::Cookie)), std::byte{0});
  store_le(hello_.data() + kAtFeatures, wire::kFeatureSealed);
  return hello_;
}

SealedClient::Step SealedClient::send_hello(const wire::Header& header, ConstBytes frame,
                                            MonotonicTime now) noexcept {
  const bool is_new =
      !is_opening_ || purpose_ != Purpose::kChannel || header.call_id != channel_number_;
  channel_number_ = header.call_id;
  if (is_new) {
    if (has_next(now) && next().granted.band.contains(header.priority)) {
      end(current());
      current_ = 1 - current_;
      return welcome_channel();
    }
    begin_handshake(Purpose::kChannel);
  }
  write_hello(frame, wire::kFeatureSealed);
  const bool is_stream = config_.medium == wire::Medium::kStream;
  if (is_stream && !has_sealed_hello_) {
    suite_ = crypto::best_suite(config_.suites, config_.suites);
    static_cast<void>(begin_message_1());
    return {};
  }
  // hp-4-5: a repetition. sec-3-1: the HELLO with message 1 repeats the same bytes.
  if (has_sealed_hello_) return {.send = sealed_hello_};
  if (!has_cookie_) return {.send = first_hello()};
  static_cast<void>(begin_message_1());
  return {};
}

// Requests message 1 from work(), for the current HELLO and cookie.
bool SealedClient::begin_message_1() noexcept {
  std::ranges::copy(ConstBytes(cookie_).first(sizeof(wire::Cookie)), hello_.begin() + kAtCookie);
  if (!has_cookie_) std::ranges::fill(MutableBytes(hello_).subspan(kAtCookie, 16), std::byte{0});
  const bool is_aes = suite_ == crypto::Suite::kAesGcm;
  store_le(hello_.data() + kAtFeatures,
           wire::kFeatureSealed | (is_aes ? wire::kFeatureAesGcm : 0U));
  return is_message_1_due_ = true;
}

SealedClient::Step SealedClient::work(MonotonicTime now) noexcept {
  if (std::exchange(is_message_1_due_, false)) return message_1();
  if (std::exchange(is_message_2_due_, false)) return message_2(now);
  return {};
}

// sec-3-1: each message 1 has its own ephemeral key.
SealedClient::Step SealedClient::message_1() noexcept {
  wire::Header header = *wire::decode(hello_);
  header.flags = 0;
  header.payload_size = header.message_size = wire::SealedHello::kSize;
  const auto payload = std::span<const std::byte, wire::Hello::kSize>(hello_payload(hello_));
  const wire::Prologue prologue =
      wire::prologue_of(header, payload, has_cookie_ ? ConstBytes(cookie_) : ConstBytes{});
  initiator_.emplace(suite_, config_.own->clone(), config_.server,
                     config_.preshared != nullptr ? config_.preshared->clone() : crypto::Secret{},
                     config_.random.draw_key(), prologue);
  // sec-6-3: asks about the session that this client still has keys for.
  const bool has_former =
      purpose_ != Purpose::kRenewal && current().seal && !current().seal->has_ended();
  std::array<std::byte, wire::kMessage1PayloadSize> former{};
  store_le(former.data(), has_former ? current().id : 0);
  wire::encode(header, sealed_hello_.data());
  std::ranges::copy(payload, sealed_hello_.begin() + wire::kHeaderSize);
  has_sealed_hello_ =
      initiator_
          ->write_message_1(former,
                            MutableBytes(sealed_hello_).last(wire::SealedHello::kMessageSize))
          .has_value();
  if (!has_sealed_hello_) return {};  // The configured key is of small order.
  return {.send = sealed_hello_};
}

// ---- handshakes: receiving ----------------------------------------------------------------------

SealedClient::Step SealedClient::receive(MutableBytes frame, MonotonicTime now) noexcept {
  ++counters_.received_count;
  if (wire::is_sealed(frame)) return receive_sealed(frame);
  wire::Header header;
  if (auto read = wire::decode_frame(frame, config_.medium, header); !read) {
    // sec-4-2: a frame of the session whose flag was taken away, whatever its size.
    const bool is_stripped = config_.medium == wire::Medium::kDatagram && wire::decode(frame) &&
                             is_current(header.session);
    Step step = drop(is_stripped ? DropReason::kUnsealed : read.error());
    step.is_broken = config_.medium == wire::Medium::kStream;
    return step;
  }
  switch (header.kind) {
    case FrameKind::kCookie:
      return on_cookie(header, frame.subspan(wire::kHeaderSize));
    case FrameKind::kWelcome:
      return on_welcome(header, frame);
    case FrameKind::kRefuse:
      return on_refuse(header, now);
    default:
      // sec-4-4, sec-6-2: an unsealed frame changes nothing in a sealed session.
      return drop(DropReason::kUnsealed);
  }
}

SealedClient::Step SealedClient::receive_sealed(MutableBytes frame) noexcept {
  const bool is_stream = config_.medium == wire::Medium::kStream;
  const auto refuse = [&](DropReason reason) {
    Step step = drop(reason);
    step.is_broken = is_stream;  // sec-5-7
    return step;
  };
  wire::Header header;
  if (auto read = wire::decode_sealed_frame(frame, config_.medium, header); !read) {
    return refuse(read.error());
  }
  if (!is_current(header.session)) return refuse(DropReason::kUnexpected);
  if (auto opened = current().seal->open(wire::kHeaderSize, frame); !opened) {
    return refuse(opened.error() == crypto::OpenError::kReplayed ? DropReason::kReplayed
                                                                 : DropReason::kBadSeal);
  }
  wire::unmark_sealed(frame.data());
  if (header.kind == FrameKind::kClose) {
    end(current());
  }
  return {.deliver = frame.first(frame.size() - crypto::kTrailerSize)};
}

SealedClient::Step SealedClient::on_cookie(const wire::Header& header,
                                           ConstBytes payload) noexcept {
  if (!is_opening_ || header.call_id != number_) return drop(DropReason::kUnexpected);
  const auto cookie = wire::decode_sealed_cookie(payload);
  if (!cookie) {
    // sec-3.1-2
    if (payload.size() == sizeof(wire::Cookie)) hint_ = wire::Status::kVersionUnsupported;
    return drop(DropReason::kBadPayload);
  }
  // sec-2-4: the configured key counts, whatever the COOKIE shows.
  other_key_.reset();
  if (cookie->server_key != config_.server) other_key_ = cookie->server_key;
  if (has_cookie_ && std::ranges::equal(payload, cookie_)) return {};
  std::ranges::copy(payload, cookie_.begin());
  has_cookie_ = true;
  has_sealed_hello_ = false;
  suite_ = crypto::best_suite(config_.suites, static_cast<std::uint8_t>(cookie->suites));
  if (purpose_ != Purpose::kChannel || config_.medium == wire::Medium::kStream) {
    static_cast<void>(begin_message_1());
    return {};
  }
  // hp-4.2-4: the channel decides whether to answer this one at once, and then passes its HELLO.
  wire::Header plain;
  plain.kind = FrameKind::kCookie;
  plain.priority = header.priority;
  plain.call_id = channel_number_;
  plain.payload_size = plain.message_size = sizeof(wire::Cookie);
  wire::encode(plain, plain_.data());
  std::ranges::copy(cookie->cookie, plain_.begin() + wire::kHeaderSize);
  return {.deliver = ConstBytes(plain_).first(wire::kHeaderSize + sizeof(wire::Cookie))};
}

SealedClient::Step SealedClient::on_welcome(const wire::Header& header, ConstBytes frame) noexcept {
  if (!is_opening_ || header.call_id != number_ || !has_sealed_hello_) {
    return drop(DropReason::kUnexpected);
  }
  if (frame.size() != kWelcomeSize) return drop(DropReason::kBadPayload);
  std::ranges::copy(frame, welcome_.begin());
  is_message_2_due_ = true;
  return {};
}

// sec-3-4: a message that can't be opened changes nothing.
SealedClient::Step SealedClient::message_2(MonotonicTime now) noexcept {
  if (!is_opening_ || !has_sealed_hello_) return {};
  std::array<std::byte, wire::SealedWelcome::kInnerSize> inner{};
  const ConstBytes message = ConstBytes(welcome_).last(wire::SealedWelcome::kSize);
  if (!initiator_->read_message_2(message, inner)) return drop(DropReason::kBadSeal);
  const auto header = wire::decode(welcome_);
  const auto features = load_le<std::uint32_t>(sealed_hello_.data() + kAtFeatures);
  const auto granted = wire::decode_sealed_welcome(inner, features);
  // sec-3.3-1. The message was authentic, so the server itself is faulty.
  const Priority asked = wire::decode(sealed_hello_)->priority;
  if (!granted || granted->session != header->session || !granted->welcome.band.contains(asked)) {
    is_opening_ = false;
    return drop(DropReason::kBadPayload);
  }
  is_opening_ = false;
  const bool is_alive = granted->former == wire::FormerSession::kAlive;
  if (is_alive && !is_current(granted->session)) return drop(DropReason::kBadPayload);
  probe_interval_ = Duration{0};
  if (is_alive) {
    initiator_.reset();
    return purpose_ == Purpose::kChannel ? welcome_channel() : Step{};
  }
  const auto keys = initiator_->keys();
  initiator_.reset();
  const bool is_stream = config_.medium == wire::Medium::kStream;
  // After a probe or a renewal, the session waits until the channel opens one.
  Session& session = purpose_ == Purpose::kChannel ? current() : next();
  session.seal.emplace(*keys, is_stream ? crypto::Order::kExact : crypto::Order::kAny,
                       config_.limits);
  session.id = granted->session;
  if (config_.key_listener.hear != nullptr) {
    config_.key_listener.hear(config_.key_listener.context, session.id, *keys);
  }
  session.granted = granted->welcome;
  session.opened = now;
  next_until_ = now + kNextMax;
  if (purpose_ == Purpose::kChannel) return welcome_channel();
  if (purpose_ == Purpose::kRenewal) return {};
  if (granted->former == wire::FormerSession::kEnded) return tell_closed();
  // sec-6-3: the server itself reported it as gone.
  gone_session_ = refused_.session;
  end(current());
  return tell_lost(refused_);
}

SealedClient::Step SealedClient::welcome_channel() noexcept {
  wire::Header plain;
  plain.kind = FrameKind::kWelcome;
  plain.priority = wire::decode(hello_)->priority;
  plain.session = current().id;
  plain.call_id = channel_number_;
  plain.payload_size = plain.message_size = wire::Welcome::kSize;
  wire::encode(plain, plain_.data());
  wire::Welcome welcome = current().granted;
  welcome.features = 0;
  wire::encode(welcome, MutableBytes(plain_).subspan(wire::kHeaderSize));
  return {.deliver = plain_};
}

// sec-6-6: the channel takes this as the server's CLOSE.
SealedClient::Step SealedClient::tell_closed() noexcept {
  wire::Header plain;
  plain.kind = FrameKind::kClose;
  plain.priority = refused_.priority;
  plain.session = current().id;
  end(current());
  wire::encode(plain, plain_.data());
  return {.deliver = ConstBytes(plain_).first(wire::kHeaderSize)};
}

SealedClient::Step SealedClient::tell_lost(const wire::Header& about) noexcept {
  wire::Header plain;
  plain.kind = FrameKind::kRefuse;
  plain.priority = about.priority;
  plain.session = about.session;
  plain.call_id = about.call_id;
  plain.status = wire::Status::kUnknownSession;
  wire::encode(plain, plain_.data());
  return {.deliver = ConstBytes(plain_).first(wire::kHeaderSize)};
}

// sec-6-2: an unsealed REFUSE ends nothing. It is a reason for a probe.
SealedClient::Step SealedClient::on_refuse(const wire::Header& header, MonotonicTime now) noexcept {
  counters_.drop(DropReason::kUnsealed);
  if (header.payload_size != 0) return {};
  if (is_opening_ && purpose_ == Purpose::kChannel) {
    if (header.call_id == number_ && header.session == 0) hint_ = header.status;
    return {};
  }
  const bool is_about_us =
      is_current(header.session) && header.status == wire::Status::kUnknownSession;
  if (!is_about_us || now < next_probe_ || config_.medium == wire::Medium::kStream) return {};
  probe_interval_ = std::clamp(2 * probe_interval_, kProbeIntervalMin, kProbeIntervalMax);
  next_probe_ = now + probe_interval_;
  refused_ = header;
  begin_handshake(Purpose::kProbe);
  store_le(hello_.data() + kAtCallId, number_);
  return {.send = first_hello()};
}

}  // namespace rtpm::sealed
