#include "network.hpp"

namespace rtpm::sim {
namespace {

// RFC 1071's sum, which UDP uses.
std::uint32_t checksum(const Bytes& bytes) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    sum += std::to_integer<std::uint32_t>(bytes[i]) << (i % 2 == 0 ? 8U : 0U);
  }
  while (sum > 0xffff)
    sum = (sum & 0xffff) + (sum >> 16);
  return sum;
}

}  // namespace

Duration Network::delay() {
  const Duration usual = random_.between(profile_.delay_min, profile_.delay_max);
  if (!random_.chance(profile_.late_per_mille)) return usual;
  return random_.between(usual, usual + profile_.late_max);
}

bool Network::is_lost() {
  if (is_partitioned_ || scheduler_.now() < burst_end_) return true;
  if (random_.chance(profile_.burst_per_mille)) {
    burst_end_ = scheduler_.now() + random_.between(Duration{0}, profile_.burst_max);
    return true;
  }
  return random_.chance(profile_.lost_per_mille);
}

// Sometimes changes two neighbouring bytes. False if the receiver's system detects that.
bool Network::arrives_whole(Bytes& frame) {
  if (frame.size() < 2 || !random_.chance(profile_.corrupted_per_mille)) return true;
  const std::uint32_t before = checksum(frame);
  const std::size_t at = random_.between(std::size_t{0}, frame.size() - 2);
  frame[at] ^= static_cast<std::byte>(random_.between(1, 255));
  frame[at + 1] ^= static_cast<std::byte>(random_.between(0, 255));
  return !profile_.has_checksum || checksum(frame) == before;
}

void Network::deliver(std::uint32_t from_port, std::uint32_t to_port, const Bytes& frame) {
  const auto receiver = receivers_.find(to_port);
  if (receiver == receivers_.end() || !receiver->second) return;
  receiver->second(frame, address_of(from_port));
}

void Network::send(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame) {
  if (tap_ && !tap_(from_port, to_port, frame)) return;
  const int copy_count = random_.chance(profile_.doubled_per_mille) ? 2 : 1;
  for (int copy = 0; copy < copy_count; ++copy) {
    if (is_lost()) continue;
    Bytes bytes(frame.begin(), frame.end());
    if (!arrives_whole(bytes)) continue;
    scheduler_.after(delay(), [this, from_port, to_port, bytes = std::move(bytes)] {
      deliver(from_port, to_port, bytes);
    });
  }
}

}  // namespace rtpm::sim
