#include "server/acceptor.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <span>

#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/stream.hpp"
#include "rtpm/wire/header.hpp"

namespace rtpm::rpc {
namespace {

// A client sends its HELLO as soon as it is connected. One that has not sent it within this time
// loses its slot.
constexpr Duration kFirstFramePatience = std::chrono::seconds{2};
// The pause between two looks for the rest of a header.
constexpr Duration kPartPause = std::chrono::milliseconds{1};
// Further connections wait for the next turn, after connections that have sent their first frame by
// then.
constexpr int kAcceptsPerTurn = 16;

// How long no connection is accepted after the system had no descriptor left even to refuse one.
constexpr Duration kShortagePause = std::chrono::milliseconds{100};

// False if the system refuses.
template <class Listener>
bool add_to_wait(transport::WaitSet& wait_set, const std::vector<Listener>& listeners,
                 transport::SourceKind kind) noexcept {
  for (std::uint32_t i = 0; i < listeners.size(); ++i) {
    const transport::SourceTag tag(kind, i);
    if (!wait_set.add(listeners[i].descriptor(), tag, transport::Trigger::kLevel)) return false;
  }
  return true;
}

}  // namespace

Acceptor::Acceptor(std::vector<transport::TcpListener> listeners,
                   std::vector<transport::SharedMemoryListener> memory_listeners,
                   std::unique_ptr<transport::WaitSet> wait_set, std::uint32_t message_size_max,
                   const transport::UserPolicy* users) noexcept
    : listeners_(std::move(listeners)),
      memory_listeners_(std::move(memory_listeners)),
      wait_set_(std::move(wait_set)),
      message_size_max_(message_size_max),
      users_(users),
      newcomers_(2 * kNewcomerCountMax) {
  const bool is_listening = listen();
  RTPM_ASSERT(is_listening, "a new wait set takes a socket");
}

// False if the system refuses.
bool Acceptor::listen() noexcept {
  listening_from_ = MonotonicTime::min();
  return add_to_wait(*wait_set_, listeners_, kListener) &&
         add_to_wait(*wait_set_, memory_listeners_, kMemoryListener);
}

// Waiting connections would wake the thread again and again.
void Acceptor::pause_listening(MonotonicTime now) noexcept {
  for (const auto& listener : listeners_)
    wait_set_->remove(listener.descriptor());
  for (const auto& listener : memory_listeners_)
    wait_set_->remove(listener.descriptor());
  listening_from_ = now + kShortagePause;
}

// Reports that a connection could not be accepted, and why.
void Acceptor::note_shortage(int error, const char* what) noexcept {
  // There may be no memory for a string.
  std::array<char, 256> text{};
  std::snprintf(text.data(), text.size(), "%s turned away (%s). Remedy: %s", what,
                std::strerror(error), transport::remedy_for_shortage(error));
  shortage_warning_.say(text.data(), rt::now());
}

expected<void, SetupError> Acceptor::start(std::vector<std::unique_ptr<Lane>>& lanes,
                                           std::vector<int> cpus) {
  lanes_ = &lanes;
  auto thread =
      rt::Thread::start({.name = "rtpm-accept", .cpus = std::move(cpus)}, [this] { run(); });
  if (!thread) return unexpected{thread.error()};
  thread_ = std::move(*thread);
  return {};
}

void Acceptor::stop() noexcept {
  is_stopping_.store(true, std::memory_order_release);
  wait_set_->ring();
  thread_.join();
  listeners_.clear();
  memory_listeners_.clear();
  newcomers_.clear();
}

template <class Listener>
void Acceptor::accept_some(Listener& listener, bool is_memory) noexcept {
  for (int i = 0; i < kAcceptsPerTurn; ++i) {
    transport::Accepted accepted = listener.accept();
    if (accepted.shortage != 0) {
      note_shortage(accepted.shortage,
                    is_memory ? "a caller on this host is" : "a connection over TCP is");
    }
    if (accepted.still_waits) pause_listening(rt::now());
    if (!accepted.socket.is_open()) return;
    // The poll should wake us only once the whole header, which holds the priority, has arrived.
    const bool may_be_part =
        !is_memory && !transport::report_from(accepted.socket.number(), wire::kHeaderSize);
    take_in(std::move(accepted.socket), is_memory, may_be_part);
  }
}

void Acceptor::run() noexcept {
  std::array<transport::SourceTag, 64> ready{};
  while (!is_stopping_.load(std::memory_order_acquire)) {
    const bool is_paused = listening_from_ != MonotonicTime::min();
    MonotonicTime until = is_paused ? listening_from_ : kNever;
    until = std::min(until, refusals_.write_due(rt::now()));
    if (open_warning_) until = std::min(until, open_warning_->tick(rt::now()));
    for (const Newcomer& newcomer : newcomers_) {
      if (newcomer.socket.is_open())
        until = std::min({until, newcomer.deadline, newcomer.next_look});
    }
    const std::size_t count = wait_set_->wait(until, ready);
    const auto events = std::span(ready).first(count);
    // Connections that have sent a frame go first; newer ones may get their slots afterwards.
    for (const transport::SourceTag tag : events) {
      if (tag.kind() == kNewcomer) place(newcomers_[tag.index()]);
    }
    for (const transport::SourceTag tag : events) {
      const std::uint32_t i = tag.index();
      if (tag.kind() == kListener) accept_some(listeners_[i], /*is_memory=*/false);
      if (tag.kind() == kMemoryListener) accept_some(memory_listeners_[i], /*is_memory=*/true);
    }
    const MonotonicTime now = rt::now();
    if (is_paused && now >= listening_from_ && !listen()) pause_listening(now);
    attend_newcomers(now);
    maintain_lanes();
  }
}

// Waits for the new connection's first frame.
void Acceptor::take_in(transport::Descriptor socket, bool is_memory, bool may_be_part) noexcept {
  Newcomer& newcomer = free_place(is_memory);
  const transport::SourceTag tag(kNewcomer,
                                 static_cast<std::uint32_t>(&newcomer - newcomers_.data()));
  if (!wait_set_->add(socket.number(), tag, transport::Trigger::kLevel)) return;
  const wire::PeerAddress host = transport::host_of(socket.number());
  newcomer = {.socket = std::move(socket),
              .is_memory = is_memory,
              .deadline = rt::now() + kFirstFramePatience,
              .host = host,
              .may_be_part = may_be_part};
}

// hp-4-8: frees a slot. If all are taken, evicts the oldest newcomer of the host that has most, so
// a host that opens connections and sends nothing locks out only itself.
Acceptor::Newcomer& Acceptor::free_place(bool is_memory) noexcept {
  const auto places =
      std::span(newcomers_).subspan(is_memory ? kNewcomerCountMax : 0, kNewcomerCountMax);
  Newcomer* best = nullptr;
  std::ptrdiff_t most = 0;
  for (Newcomer& each : places) {
    if (!each.socket.is_open()) return each;
    const std::ptrdiff_t count = std::ranges::count_if(
        places, [&](const Newcomer& other) { return is_same_host(other.host, each.host); });
    if (count < most || (count == most && each.deadline >= best->deadline)) continue;
    best = &each;
    most = count;
  }
  // Its first frame may have arrived by now.
  std::array<std::byte, wire::kHeaderSize> first{};
  const bool has_spoken =
      is_memory || transport::peek(best->socket.number(), first) == first.size();
  if (has_spoken) {
    place(*best);
  } else {
    end(*best);
  }
  return *best;
}

void Acceptor::end(Newcomer& newcomer) noexcept {
  wait_set_->remove(newcomer.socket.number());
  newcomer = {};
}

// Hands the connection to its lane (hp-11-2) without consuming a frame, or ends it.
void Acceptor::place(Newcomer& newcomer) noexcept {
  if (!newcomer.socket.is_open()) return;
  wait_set_->remove(newcomer.socket.number());
  std::array<std::byte, wire::kHeaderSize> first{};
  const std::size_t size =
      newcomer.is_memory ? 0 : transport::peek(newcomer.socket.number(), first);
  if (newcomer.may_be_part && size > 0 && size < first.size()) {
    newcomer.next_look = rt::now() + kPartPause;
    return;
  }
  transport::Descriptor socket = std::move(newcomer.socket);
  const bool is_memory = newcomer.is_memory;
  newcomer = {};
  if (is_memory) {
    auto client = transport::welcome_shared_memory_client(std::move(socket), users_);
    if (client.shortage != 0) {
      note_shortage(client.shortage, "a caller that wants shared memory is");
    }
    if (client.connection) hand_over(client.priority, std::move(client.connection));
    return;
  }
  if (size == 0) return;
  // Malformed frames go to the lowest lane, which counts them.
  const auto header = wire::decode(ConstBytes(first).first(size));
  const Priority priority = header ? header->priority : Priority{0};
  static_cast<void>(transport::report_from(socket.number(), 1));
  transport::set_traffic_class(socket.number(), priority);
  hand_over(priority, std::make_unique<transport::FrameStream>(std::move(socket), message_size_max_,
                                                               /*takes_sealed=*/users_ != nullptr));
}

void Acceptor::hand_over(Priority priority,
                         std::unique_ptr<transport::Connection> connection) noexcept {
  for (const auto& lane : *lanes_) {
    if (!lane->band().contains(priority)) continue;
    // If the lane is full, the connection stays here and is destroyed.
    static_cast<void>(lane->adopt(connection));
    return;
  }
}

// Looks again for the headers that are due, and drops newcomers that are late.
void Acceptor::attend_newcomers(MonotonicTime now) noexcept {
  for (Newcomer& newcomer : newcomers_) {
    if (newcomer.next_look <= now) place(newcomer);
    if (newcomer.socket.is_open() && newcomer.deadline <= now) end(newcomer);
  }
}

void Acceptor::maintain_lanes() noexcept {
  for (const auto& lane : *lanes_) {
    while (lane->take_back() != nullptr) {
    }
    lane->maintain_threads();
  }
}

}  // namespace rtpm::rpc
