#pragma once

#include <sys/socket.h>

#include <cstddef>
#include <vector>

inline int poll(pollfd* entries, std::size_t count, int time_ms) noexcept {
  return WSAPoll(entries, static_cast<ULONG>(count), time_ms);
}

namespace rtpm::test {

/// An entry of poll(2), whose descriptor is an int.
struct PollEntry {
  int fd;
  short events;
  short revents;
};

}  // namespace rtpm::test

inline int poll(rtpm::test::PollEntry* entries, std::size_t count, int time_ms) noexcept {
  std::vector<pollfd> native;
  for (std::size_t i = 0; i < count; ++i)
    native.push_back({static_cast<SOCKET>(entries[i].fd), entries[i].events, 0});
  const int ready = poll(native.data(), count, time_ms);
  for (std::size_t i = 0; i < count; ++i)
    entries[i].revents = native[i].revents;
  return ready;
}
#define pollfd rtpm::test::PollEntry
