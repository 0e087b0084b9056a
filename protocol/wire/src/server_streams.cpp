#include "rtpm/wire/server_streams.hpp"

namespace rtpm::wire {

ServerStreams::ServerStreams(MutableBytes memory, Medium medium)
    : memory_(memory),
      medium_(medium),
      streams_(std::min<std::size_t>(memory.size() / stream_buffer_size(medium), kNone - 1U)) {}

std::uint16_t ServerStreams::begin(const Header& header, const CallPlace& call,
                                   std::uint32_t fragment_size, MonotonicTime deadline) noexcept {
  const auto found =
      std::ranges::find_if(streams_, [](const Stream& stream) { return !stream.items.is_begun(); });
  if (found == streams_.end()) return kNone;
  const auto index = static_cast<std::size_t>(found - streams_.begin());
  const std::size_t size = stream_buffer_size(medium_);
  found->call = call;
  found->deadline = deadline;
  found->items.begin(
      header,
      {.memory = memory_.subspan(index * size, size),
       .frame_size = medium_ == Medium::kDatagram ? kDatagramFrameSizeMax : kStreamFrameSizeMax,
       .fragment_size = fragment_size},
      medium_);
  due_ = std::min(due_, deadline);
  ++open_count_;
  return static_cast<std::uint16_t>(index);
}

void ServerStreams::end(std::uint16_t index) noexcept {
  streams_[index].items.clear();
  if (--open_count_ == 0) due_ = kNever;
}

ConstBytes ServerStreams::next_repair() noexcept {
  const ConstBytes frame = streams_[repairing_].items.next();
  if (frame.empty()) repairing_ = kNone;
  return frame;
}

}  // namespace rtpm::wire
