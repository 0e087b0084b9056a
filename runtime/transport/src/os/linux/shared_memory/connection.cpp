#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"
#include "rtpm/wire/limits.hpp"
#include "shared_memory/memory.hpp"
#include "shared_memory/setup.hpp"

namespace rtpm::transport {
namespace {

// The interval at which a full ring is checked: its reader is busy or dead.
constexpr Duration kSpaceCheckInterval = std::chrono::microseconds{50};

using Side = SharedMemoryConnection::Side;

Side other(Side side) noexcept {
  return side == Side::kClient ? Side::kServer : Side::kClient;
}

// The ring that `reader` reads. The control words start at 0, like all fresh memory.
RecordRingMemory ring_to(Side reader, MutableBytes memory, RingSizes sizes) noexcept {
  const bool is_to_server = reader == Side::kServer;
  std::byte* const control =
      memory.data() + (is_to_server ? kToServerControlOffset : kToClientControlOffset);
  return {
      *reinterpret_cast<RecordRingControl*>(control),
      memory.subspan(is_to_server ? kToServerSlotsOffset : kToClientSlotsOffset, kRecordSlotsSize),
      is_to_server ? memory.subspan(kRingDataOffset, sizes.to_server)
                   : memory.subspan(kRingDataOffset + sizes.to_server, sizes.to_client)};
}

}  // namespace

SharedMemoryConnection::SharedMemoryConnection(Descriptor socket, Descriptor event,
                                               SharedMapping mapping, RingSizes sizes, Side side)
    : socket_(std::move(socket)),
      event_(std::move(event)),
      mapping_(std::move(mapping)),
      writer_(ring_to(other(side), mapping_.bytes(), sizes)),
      reader_(ring_to(side, mapping_.bytes(), sizes)),
      sleep_(side == Side::kServer ? RecordSleep::kAtEvent : RecordSleep::kAtBell),
      lines_(wire::kSharedFrameSizeMax / sizeof(CacheLine)) {
  RTPM_ASSERT(mapping_.bytes().size() == memory_size(sizes), "a connection has its rings");
}

expected<void, IoError> SharedMemoryConnection::send(ConstBytes frame,
                                                     MonotonicTime until) noexcept {
  if (frame.empty() || frame.size() > wire::kSharedFrameSizeMax) {
    return unexpected{IoError::kFailed};
  }
  while (true) {
    switch (writer_.write(frame)) {
      case RecordWriter::Outcome::kWrittenForBell:
        ring_bell();
        return {};
      case RecordWriter::Outcome::kWrittenForWord:
        wake_on_word(writer_.sleeping());
        return {};
      case RecordWriter::Outcome::kWrittenForEvent:
        signal_event();
        return {};
      case RecordWriter::Outcome::kWritten:
        return {};
      case RecordWriter::Outcome::kBroken:
        return unexpected{IoError::kBroken};
      case RecordWriter::Outcome::kFull:
        break;
    }
    if (is_closed_) return unexpected{IoError::kClosed};
    if (rt::now() >= until) return unexpected{IoError::kFull};
    if (!await_space(until)) return unexpected{IoError::kClosed};
  }
}

expected<MutableBytes, IoError> SharedMemoryConnection::receive() noexcept {
  const MutableBytes buffer(lines_.front().bytes, wire::kSharedFrameSizeMax);
  const auto size = reader_.read(buffer);
  if (size) return buffer.first(*size);
  if (size.error() == RecordError::kBroken) return unexpected{IoError::kBroken};
  return unexpected{is_closed_ ? IoError::kClosed : IoError::kNothing};
}

// Never waits: if the socket is full, the peer has already been woken (hp-16.3-3).
void SharedMemoryConnection::ring_bell() noexcept {
  const std::byte bell{};
  const ssize_t size = ::send(socket_.number(), &bell, sizeof bell, MSG_DONTWAIT | MSG_NOSIGNAL);
  static_cast<void>(size);
}

// hp-16.3-3
void SharedMemoryConnection::signal_event() noexcept {
  const std::uint64_t one = 1;
  const ssize_t size = ::write(event_.number(), &one, sizeof one);
  static_cast<void>(size);
}

void SharedMemoryConnection::wait_for_frame(MonotonicTime until) noexcept {
  if (reader_.announce_sleep(RecordSleep::kAtWord) && !is_closed_) {
    const rt::AsleepScope asleep;
    sleep_on_word(reader_.sleeping(), static_cast<std::uint32_t>(RecordSleep::kAtWord), until);
  }
  reader_.end_sleep();
}

// Reads one bell at a time; further ones keep the socket readable and cause spurious wake-ups
// (hp-16.3-2).
void SharedMemoryConnection::check_peer() noexcept {
  std::byte bell{};
  const ssize_t size = recv(socket_.number(), &bell, sizeof bell, MSG_DONTWAIT);
  if (size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR)) is_closed_ = true;
}

// Pauses briefly; false if the peer is gone.
bool SharedMemoryConnection::await_space(MonotonicTime until) noexcept {
  pollfd entry{socket_.number(), 0, 0};
  const Duration pause = std::clamp<Duration>(until - rt::now(), Duration{0}, kSpaceCheckInterval);
  const timespec timeout = rt::to_timespec(pause);
  return ppoll(&entry, 1, &timeout, nullptr) <= 0;
}

}  // namespace rtpm::transport
