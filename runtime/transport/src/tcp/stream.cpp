#include "rtpm/transport/stream.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "os/native_socket.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/sealed.hpp"

namespace rtpm::transport {
namespace {

// The most bytes that one system call moves. In a kernel without preemption a thread inside a
// system call keeps its CPU from more urgent ones, so copying a whole large frame would delay a
// small call of a higher band. Half of this would gain little, and slow down large messages
// considerably.
constexpr std::size_t kStepSizeMax = std::size_t{32} * 1024;

// A window of fragments, which Linux's default send buffer accepts without waiting.
constexpr std::size_t kUnsentMax =
    wire::kStreamFragmentWindow * std::size_t{wire::kStreamFrameSizeMax};

bool is_nothing(int error) noexcept {
  return error == EAGAIN || error == EWOULDBLOCK || error == EINTR;
}

}  // namespace

FrameStream::FrameStream(Descriptor socket, std::uint32_t message_size_max, bool takes_sealed)
    : socket_(std::move(socket)),
      takes_sealed_(takes_sealed),
      lines_((wire::kHeaderSize + message_size_max + wire::kSealedTrailerSize + sizeof(CacheLine) -
              1) /
             sizeof(CacheLine)) {
  limit_blocking(socket_.number());
  int size = 0;
  socklen_t length = sizeof size;
  getsockopt(socket_.number(), SOL_SOCKET, SO_SNDBUF, &size, &length);
  // Linux doubles the requested size for its own bookkeeping.
  waiting_max_ = std::min(kUnsentMax, static_cast<std::size_t>(std::max(size, 0)) / 2);
}

MutableBytes FrameStream::buffer() noexcept {
  return {lines_.front().bytes, lines_.size() * sizeof(CacheLine)};
}

std::size_t FrameStream::complete_size(std::size_t at) const noexcept {
  const ConstBytes filled = ConstBytes(lines_.front().bytes, filled_size_).subspan(at);
  if (filled.size() < wire::kHeaderSize) return 0;
  const bool may_be = takes_sealed_ || !wire::is_sealed(filled);
  const std::size_t size = may_be ? wire::frame_size(filled) : 0;
  // Malformed bytes are returned at once, so that no peer can make the receiver wait for them.
  if (size == 0 || size > lines_.size() * sizeof(CacheLine)) return wire::kHeaderSize;
  return filled.size() >= size ? size : 0;
}

bool FrameStream::has_buffered() const noexcept {
  return filled_size_ > given_size_ && complete_size(given_size_) > 0;
}

expected<MutableBytes, IoError> FrameStream::receive() noexcept {
  return receive(MSG_DONTWAIT);
}

expected<MutableBytes, IoError> FrameStream::await() noexcept {
  return receive(0);
}

expected<MutableBytes, IoError> FrameStream::receive(int flags) noexcept {
  release_given();
  std::size_t size = filled_size_ > 0 ? complete_size(0) : 0;
  while (size == 0) {
    const std::size_t step_size = std::min(buffer().size() - filled_size_, kStepSizeMax);
    const std::ptrdiff_t count = fill(flags);
    if (count == 0) return unexpected{IoError::kClosed};
    if (count < 0) return unexpected{is_nothing(errno) ? IoError::kNothing : IoError::kClosed};
    size = complete_size(0);
    if (size == 0 && static_cast<std::size_t>(count) < step_size) {
      return unexpected{IoError::kNothing};
    }
  }
  given_size_ = size;
  return buffer().first(size);
}

// Moves the next frame to the beginning of the buffer, so that its payload is aligned.
void FrameStream::release_given() noexcept {
  if (given_size_ == 0) return;
  filled_size_ -= given_size_;
  if (filled_size_ > 0) {
    std::memmove(buffer().data(), buffer().data() + given_size_, filled_size_);
  }
  given_size_ = 0;
}

// Receives once, appending to the filled part.
std::ptrdiff_t FrameStream::fill(int flags) noexcept {
  const MutableBytes free = buffer().subspan(filled_size_);
  const std::size_t size = std::min(free.size(), kStepSizeMax);
  const std::ptrdiff_t count = recv(socket_.number(), free.data(), size, flags);
  if (count > 0) filled_size_ += static_cast<std::size_t>(count);
  return count;
}

// The socket's buffer holds more; the rest is left to frames that may not wait.
bool FrameStream::has_spare_capacity(std::size_t size) noexcept {
  const auto waiting = os::unacknowledged_size(socket_.number());
  // If the connection has ended, the send reports it.
  return waiting.value_or(0) == 0 || *waiting + size <= waiting_max_;
}

expected<void, IoError> FrameStream::send(ConstBytes frame, MonotonicTime until) noexcept {
  while (true) {
    const std::ptrdiff_t count =
        ::send(socket_.number(), frame.data(), std::min(frame.size(), kStepSizeMax),
               MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count >= 0) {
      frame = frame.subspan(static_cast<std::size_t>(count));
      if (frame.empty()) return {};
      continue;
    }
    if (errno == EINTR) continue;
    if (errno != EAGAIN && errno != EWOULDBLOCK) return unexpected{IoError::kClosed};
    if (rt::now() >= until || !wait_writable(socket_.number(), until)) {
      return unexpected{IoError::kFull};
    }
  }
}

}  // namespace rtpm::transport
