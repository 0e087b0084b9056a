#include "network.hpp"

namespace rtpm::sim {

Duration Network::delay() {
  const Duration usual = random_.between(profile_.delay_min, profile_.delay_max);
  if (!random_.chance(profile_.late_per_mille)) return usual;
  return random_.between(usual, usual + profile_.late_max);
}

void Network::send(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame) {
  const int copy_count = random_.chance(profile_.doubled_per_mille) ? 2 : 1;
  for (int copy = 0; copy < copy_count; ++copy) {
    if (is_partitioned_ || random_.chance(profile_.lost_per_mille)) continue;
    scheduler_.after(delay(),
                     [this, from_port, to_port, bytes = Bytes(frame.begin(), frame.end())] {
                       const auto receiver = receivers_.find(to_port);
                       if (receiver == receivers_.end() || !receiver->second) return;
                       receiver->second(bytes, {.high = 0, .low = 0x7f00'0001, .port = from_port});
                     });
  }
}

}  // namespace rtpm::sim
