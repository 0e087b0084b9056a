#include "answer_limit.hpp"

#include <chrono>

namespace rtpm::discovery {

bool AnswerLimit::Count::admit(std::uint32_t count_max, MonotonicTime now) noexcept {
  if (now - begin >= std::chrono::seconds{1}) {
    begin = now;
    count = 0;
  }
  return count++ < count_max;
}

// hp-10.1-6
bool AnswerLimit::admit(std::uint32_t host, MonotonicTime now) noexcept {
  // Neighbours on a LAN differ in the last byte; 127.0.0.0/8 is one host.
  const std::uint32_t place = host >> 24 == 127 ? 127 : host;
  return hosts_[place % hosts_.size()].admit(kPerHostAndSecond, now) &&
         all_.admit(kInAllPerSecond, now);
}

}  // namespace rtpm::discovery
