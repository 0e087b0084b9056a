#include "acceptor.hpp"

#include <algorithm>
#include <array>

#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/stream.hpp"
#include "rtpm/wire/header.hpp"

namespace rtpm::rpc {
namespace {

// A client sends its HELLO as soon as it is connected; who has not by then holds a place in vain.
constexpr Duration kFirstFramePatience = std::chrono::seconds{2};

}  // namespace

Acceptor::Acceptor(transport::TcpListener listener,
                   std::optional<transport::SharedMemoryListener> memory_listener,
                   transport::Poller poller, std::uint32_t message_size_max) noexcept
    : listener_(std::move(listener)),
      memory_listener_(std::move(memory_listener)),
      poller_(std::move(poller)),
      message_size_max_(message_size_max),
      newcomers_(kNewcomerCountMax) {
  const bool is_added =
      poller_.add(listener_->descriptor(), kListener) &&
      (!memory_listener_ || poller_.add(memory_listener_->descriptor(), kMemoryListener));
  RTPM_ASSERT(is_added, "a new poller takes a socket");
}

expected<void, rt::RealtimeError> Acceptor::start(std::vector<std::unique_ptr<Lane>>& lanes,
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
  poller_.ring();
  thread_.join();
  listener_.reset();
  memory_listener_.reset();
  newcomers_.clear();
}

void Acceptor::run() noexcept {
  std::array<std::uint64_t, 64> ready{};
  while (!is_stopping_.load(std::memory_order_acquire)) {
    MonotonicTime until = kNever;
    for (const Newcomer& newcomer : newcomers_) {
      if (newcomer.socket.is_open()) until = std::min(until, newcomer.deadline);
    }
    const std::size_t count = poller_.wait(until, ready);
    for (std::size_t i = 0; i < count; ++i) {
      if (ready[i] == kListener) {
        accept_one();
      } else if (ready[i] == kMemoryListener) {
        accept_one_to_memory();
      } else if (ready[i] != transport::Poller::kBell) {
        place(newcomers_[ready[i]]);
      }
    }
    drop_late(rt::now());
    mind_lanes();
  }
}

void Acceptor::accept_one() noexcept {
  transport::Descriptor socket = listener_->accept();
  if (!socket.is_open()) return;
  // The poll shall wake us when the header, which has the priority, is there as a whole.
  transport::report_from(socket.number(), wire::kHeaderSize);
  take_in(std::move(socket), /*is_memory=*/false);
}

void Acceptor::accept_one_to_memory() noexcept {
  transport::Descriptor socket = memory_listener_->accept();
  if (socket.is_open()) take_in(std::move(socket), /*is_memory=*/true);
}

// Waits for what the newcomer has to say.
void Acceptor::take_in(transport::Descriptor socket, bool is_memory) noexcept {
  const auto free =
      std::ranges::find_if(newcomers_, [](const Newcomer& n) { return !n.socket.is_open(); });
  // Too many that say nothing: the newest goes, and its client sees that at once.
  if (free == newcomers_.end()) return;
  if (!poller_.add(socket.number(), static_cast<std::uint64_t>(free - newcomers_.begin()))) return;
  *free = {std::move(socket), is_memory, rt::now() + kFirstFramePatience};
}

// Hands the connection to its lane (hp-11-2) with no frame taken from it, or ends it.
void Acceptor::place(Newcomer& newcomer) noexcept {
  if (!newcomer.socket.is_open()) return;
  transport::Descriptor socket = std::move(newcomer.socket);
  newcomer.socket = {};
  poller_.remove(socket.number());
  if (newcomer.is_memory) {
    auto client = transport::welcome_shared_memory_client(std::move(socket));
    if (client) hand_over(client->priority, std::move(client->connection));
    return;
  }
  std::array<std::byte, wire::kHeaderSize> first{};
  const std::size_t size = transport::peek(socket.number(), first);
  if (size == 0) return;
  // Garbage goes to the lowest lane, which counts it.
  const auto header = wire::decode(ConstBytes(first).first(size));
  const Priority priority = header ? header->priority : Priority{0};
  transport::report_from(socket.number(), 1);
  transport::set_traffic_class(socket.number(), priority);
  hand_over(priority,
            std::make_unique<transport::FrameStream>(std::move(socket), message_size_max_));
}

void Acceptor::hand_over(Priority priority,
                         std::unique_ptr<transport::Connection> connection) noexcept {
  for (const auto& lane : *lanes_) {
    if (!lane->band().contains(priority)) continue;
    // A full lane leaves the connection here, where it ends.
    static_cast<void>(lane->adopt(connection));
    return;
  }
}

void Acceptor::drop_late(MonotonicTime now) noexcept {
  for (Newcomer& newcomer : newcomers_) {
    if (!newcomer.socket.is_open() || newcomer.deadline > now) continue;
    poller_.remove(newcomer.socket.number());
    newcomer.socket = {};
  }
}

void Acceptor::mind_lanes() noexcept {
  for (const auto& lane : *lanes_) {
    while (lane->take_back() != nullptr) {
    }
    lane->mind_threads();
  }
}

}  // namespace rtpm::rpc
