#include "rtpm/sealed/server.hpp"

#include <algorithm>
#include <memory>
#include <new>

#include "rtpm/base/assert.hpp"

// The frames of sealed sessions.
namespace rtpm::sealed {
namespace {

using namespace std::chrono_literals;

// The bits of the index in a ServerSessions session number.
constexpr std::uint64_t kIndexBits = 0xffff;
constexpr std::size_t kAtBudget = 40;  // The budget's offset in a header.
/// hp-5.5-2: clients judge by the state 30 s ago.
constexpr Duration kEndedMemory = 2 * wire::kSessionIdleMin;

}  // namespace

using wire::DropReason;
using wire::FrameKind;

SealedServer::Layout SealedServer::layout_of(const SealedServerConfig& config) noexcept {
  const auto lines_of = [](std::size_t size) {
    return (size + sizeof(CacheLine) - 1) / sizeof(CacheLine) * sizeof(CacheLine);
  };
  static_assert(alignof(Entry) <= sizeof(CacheLine) && alignof(HandshakeJob) <= sizeof(CacheLine));
  Layout layout;
  layout.entries = lines_of(sizeof(Guard));
  layout.jobs = layout.entries + lines_of(config.session_count_max * sizeof(Entry));
  layout.size = layout.jobs + lines_of(config.job_count_max * sizeof(HandshakeJob));
  return layout;
}

std::size_t SealedServer::memory_size(const SealedServerConfig& config) noexcept {
  return layout_of(config).size;
}

SealedServer::SealedServer(const SealedServerConfig& config, wire::ServerSessions& sessions)
    : config_(config),
      sessions_(sessions),
      cookies_(config.key),
      job_limit_(config.key, config.job_burst, config.job_interval),
      refusal_limit_(config.key, wire::kStrangerAnswerBurst, wire::kStrangerAnswerInterval),
      sealed_frame_(wire::kHeaderSize + wire::frame_payload_max(config.medium)) {
  RTPM_ASSERT(config.identity != nullptr && config.admission != nullptr,
              "a server that seals has a key, and knows whom it admits");
  const Layout layout = layout_of(config);
  MutableBytes memory = config.memory;
  if (memory.empty()) {
    own_memory_.resize(layout.size / sizeof(CacheLine));
    memory = {own_memory_.front().bytes, layout.size};
  }
  RTPM_ASSERT(memory.size() >= layout.size, "there is memory for all keys");
  guard_ = new (memory.data()) Guard;
  auto* const entries = reinterpret_cast<Entry*>(memory.data() + layout.entries);
  auto* const jobs = reinterpret_cast<HandshakeJob*>(memory.data() + layout.jobs);
  std::uninitialized_value_construct_n(entries, config.session_count_max);
  std::uninitialized_value_construct_n(jobs, config.job_count_max);
  entries_ = {entries, config.session_count_max};
  jobs_ = {jobs, config.job_count_max};
  unsealed_generation_ = reviewing_generation_ = config.admission->generation();
}

SealedServer::~SealedServer() {
  std::ranges::destroy(jobs_);
  std::ranges::destroy(entries_);
}

// Returns the session's entry; frees it if the session has ended.
SealedServer::Entry* SealedServer::find(std::uint64_t session) noexcept {
  const auto index = static_cast<std::size_t>(session & kIndexBits);
  if (session == 0 || index >= entries().size() || entries()[index].id != session) return nullptr;
  if (sessions_.is_known(session)) return &entries()[index];
  free(entries()[index]);
  return nullptr;
}

void SealedServer::free(Entry& entry) noexcept {
  entry.session.reset();
  entry.id = 0;
  entry.has_welcome = entry.is_confirmed = false;
}

// Ends a session in ServerSessions on behalf of its client.
void SealedServer::close(Entry& entry, MonotonicTime now) noexcept {
  wire::Header header;
  header.kind = FrameKind::kClose;
  header.session = entry.id;
  std::array<std::byte, wire::kHeaderSize> frame;
  wire::encode(header, frame.data());
  static_cast<void>(sessions_.on_frame(frame, entry.peer, now));
  free(entry);
}

// sec-6-6: ends a session that its client may still use, and whose open calls may have run.
void SealedServer::end(Entry& entry, MonotonicTime now) noexcept {
  ended_until_ = now + kEndedMemory;
  close(entry, now);
}

SealedServer::Outcome SealedServer::drop(DropReason reason) noexcept {
  ++counters_.received_count;
  counters_.drop(reason);
  return {};
}

SealedServer::Outcome SealedServer::broken(DropReason reason) noexcept {
  Outcome outcome = drop(reason);
  // sec-5-7; so the client does not wait for an answer that never comes.
  if (config_.medium == wire::Medium::kStream) {
    outcome.verdict.action = wire::Verdict::Action::kHangUp;
  }
  return outcome;
}

SealedServer::Outcome SealedServer::on_frame(MutableBytes frame, const wire::PeerAddress& peer,
                                             MonotonicTime now) noexcept {
  // sec-5-2: a child has neither keys nor sessions.
  if (is_wiped()) [[unlikely]]
    return {};
  if (wire::is_sealed(frame)) return on_sealed(frame, peer, now);
  wire::Header header;
  const auto read = wire::decode_frame(frame, config_.medium, header);
  if (read && header.kind == FrameKind::kHello) return on_hello(header, frame, peer, now);
  // sec-4-2, sec-4-4: an unsealed frame never reaches a sealed session, whatever its size. The size
  // of a stream's frame has to be good, as it tells where the next one begins.
  const bool is_readable =
      read || (config_.medium == wire::Medium::kDatagram && wire::decode(frame));
  if (is_readable && find(header.session) != nullptr) return drop(DropReason::kUnsealed);
  return {.verdict = sessions_.on_frame(frame, peer, now)};
}

// sec-4-2: checks session, address, counter and tag; after that the frame is handled like any
// other.
SealedServer::Outcome SealedServer::on_sealed(MutableBytes frame, const wire::PeerAddress& peer,
                                              MonotonicTime now) noexcept {
  wire::Header header;
  if (auto read = wire::decode_sealed_frame(frame, config_.medium, header); !read) {
    return broken(read.error());
  }
  const MutableBytes plain = frame.first(frame.size() - crypto::kTrailerSize);
  Entry* const entry = find(header.session);
  if (entry == nullptr || !entry->session) {
    // The session is not sealed, or has no keys yet.
    if (sessions_.is_known(header.session)) return drop(DropReason::kUnexpected);
    // The sessions refuse it, which is a hint for the client (sec-6-2).
    wire::unmark_sealed(frame.data());
    return {.verdict = sessions_.on_frame(plain, peer, now)};
  }
  if (!(entry->peer == peer)) return drop(DropReason::kForeignAddress);
  if (auto opened = entry->session->open(wire::kHeaderSize, frame); !opened) {
    if (entry->session->has_ended()) end(*entry, now);
    return broken(opened.error() == crypto::OpenError::kReplayed ? DropReason::kReplayed
                                                                 : DropReason::kBadSeal);
  }
  if (!entry->is_confirmed) confirm(*entry, now);
  entry->last_heard = now;
  if (is_held_back(*entry, header, frame, now)) return {};
  wire::unmark_sealed(frame.data());
  return {.verdict = sessions_.on_frame(plain, peer, now)};
}

// sec-6-1: only now does the session replace an earlier one of its channel.
void SealedServer::confirm(Entry& entry, MonotonicTime now) noexcept {
  entry.is_confirmed = true;
  for (Entry& other : entries()) {
    const bool is_of_channel = other.id != 0 && &other != &entry && other.peer == entry.peer &&
                               other.client_epoch == entry.client_epoch &&
                               other.channel == entry.channel && other.client == entry.client;
    const auto ahead = static_cast<std::int32_t>(entry.handshake_number - other.handshake_number);
    if (is_of_channel && ahead > 0) close(other, now);
  }
}

std::optional<wire::Outgoing> SealedServer::review(std::uint32_t index,
                                                   MonotonicTime now) noexcept {
  Admission& admission = *config_.admission;
  if (index == 0) reviewing_generation_ = admission.generation();
  const std::uint32_t since = unsealed_generation_;
  if (index + 1 == config_.session_count_max) unsealed_generation_ = reviewing_generation_;
  const auto peer = sessions_.peer_at(index);
  if (!peer) return std::nullopt;
  Entry& entry = entries()[index];
  if (!sessions_.is_known(entry.id)) {
    if (admission.keeps(nullptr, *peer, since)) return std::nullopt;
    return sessions_.close_at(index, now);
  }
  // Read first: if grants change meanwhile, the next review checks the session again.
  const std::uint32_t generation = admission.generation();
  if (admission.keeps(&entry.client, entry.peer, entry.generation)) {
    entry.generation = generation;
    return std::nullopt;
  }
  const ConstBytes frame = seal_close(entry, now);
  end(entry, now);
  return wire::Outgoing{frame, *peer};
}

void SealedServer::end_unadmitted(MonotonicTime now) noexcept {
  for (std::uint32_t index = 0; index < config_.session_count_max; ++index)
    static_cast<void>(review(index, now));
}

// Seals a CLOSE; empty while there are no keys.
ConstBytes SealedServer::seal_close(Entry& entry, MonotonicTime now) noexcept {
  if (!entry.session) return {};
  wire::Header header;
  header.kind = FrameKind::kClose;
  header.session = entry.id;
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  std::array<std::byte, wire::kHeaderSize> frame;
  wire::encode(header, frame.data());
  return seal(frame);
}

// sec-6.1-1, sec-6.1-2
bool SealedServer::is_held_back(Entry& entry, const wire::Header& header, MutableBytes frame,
                                MonotonicTime now) noexcept {
  const Duration late = entry.freshness.take(header.sender_time_ns, now) - Freshness::kTolerance;
  if (header.kind != FrameKind::kCall || header.budget_us == wire::kBudgetUnlimited ||
      late <= Duration{0}) {
    return false;
  }
  const Duration left = std::chrono::microseconds{header.budget_us} - late;
  if (left > Duration{0}) {
    // If both sides use the same clock, the sessions detect it themselves.
    if (!entry.has_our_clock) {
      store_le(frame.data() + kAtBudget, static_cast<std::uint32_t>(left / 1us));
    }
    return false;
  }
  ++counters_.received_count;
  ++counters_.expired_count;
  if (entry.freshness.has_still_clock(now)) end(entry, now);
  return true;
}

ConstBytes SealedServer::seal(ConstBytes frame) noexcept {
  if (frame.size() < wire::kHeaderSize || is_wiped()) return {};
  const auto header = wire::decode(frame);
  if (!header || header->kind == FrameKind::kWelcome || header->kind == FrameKind::kCookie) {
    return frame;
  }
  const auto index = static_cast<std::size_t>(header->session & kIndexBits);
  if (header->session == 0 || index >= entries().size() || entries()[index].id != header->session) {
    // A refusal to an unknown peer, or a frame of an unsealed session.
    const bool may_go = config_.takes_unsealed || (header && header->kind == FrameKind::kRefuse);
    return may_go ? frame : ConstBytes{};
  }
  Entry& entry = entries()[index];
  if (!entry.session) return {};
  RTPM_ASSERT(frame.size() + crypto::kTrailerSize <= sealed_frame_.size(),
              "the sessions' frames leave space for the seal");
  const MutableBytes out = MutableBytes(sealed_frame_).first(frame.size() + crypto::kTrailerSize);
  std::ranges::copy(frame.first(wire::kHeaderSize), out.begin());
  wire::mark_sealed(out.data());
  if (!entry.session->seal(out.first(wire::kHeaderSize), frame.subspan(wire::kHeaderSize), out)) {
    return {};
  }
  return out;
}

std::optional<crypto::PublicKey> SealedServer::client_of(std::uint64_t session) noexcept {
  const Entry* const entry = find(session);
  if (entry == nullptr) return std::nullopt;
  return entry->client;
}

std::uint32_t SealedServer::half_open_count() const noexcept {
  return static_cast<std::uint32_t>(std::ranges::count_if(
      entries(), [](const Entry& entry) { return entry.id != 0 && !entry.is_confirmed; }));
}

}  // namespace rtpm::sealed
