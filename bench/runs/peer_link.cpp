#include "runs/peer_link.hpp"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {

bool send_line(int link, const nlohmann::json& line) {
  const std::string text = line.dump() + "\n";
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t size = send(link, text.data() + done, text.size() - done, MSG_NOSIGNAL);
    if (size <= 0) return false;
    done += static_cast<std::size_t>(size);
  }
  return true;
}

// Each end asks and answers by turns, so nothing lies behind a line.
std::optional<nlohmann::json> receive_line(int link, Duration patience) {
  const MonotonicTime end = patience == Duration::max() ? kNever : rt::now() + patience;
  std::string text;
  std::array<char, 65'536> part{};
  while (text.empty() || text.back() != '\n') {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - rt::now()).count();
    pollfd waiting{.fd = link, .events = POLLIN, .revents = 0};
    const int timeout_ms = end == kNever ? -1 : static_cast<int>(std::max<std::int64_t>(left, 0));
    const int ready = poll(&waiting, 1, timeout_ms);
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return std::nullopt;
    const ssize_t size = recv(link, part.data(), part.size(), 0);
    if (size <= 0) return std::nullopt;
    text.append(part.data(), static_cast<std::size_t>(size));
  }
  return nlohmann::json::parse(text);
}

}  // namespace rtpm::bench
