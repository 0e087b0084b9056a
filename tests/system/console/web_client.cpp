#include "web_client.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

namespace rtpm::system_test {
namespace {

using Clock = std::chrono::steady_clock;

constexpr Duration kAnswerPatience = std::chrono::seconds{15};

int left_ms(Clock::time_point end) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
  return static_cast<int>(std::max<std::int64_t>(left.count(), 0));
}

std::string host_of(std::uint16_t port) {
  return "Host: 127.0.0.1:" + std::to_string(port) + "\r\n";
}

}  // namespace

Socket::Socket(std::uint16_t port) : handle_(::socket(AF_INET, SOCK_STREAM, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(handle_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    ::close(std::exchange(handle_, -1));
  }
}

Socket::Socket(Socket&& other) noexcept : handle_(std::exchange(other.handle_, -1)) {}
Socket& Socket::operator=(Socket&& other) noexcept {
  std::swap(handle_, other.handle_);
  return *this;
}
Socket::~Socket() {
  if (handle_ >= 0) ::close(handle_);
}

bool Socket::send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(handle_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  return true;
}

std::string Socket::receive(Duration patience) {
  pollfd wait{.fd = handle_, .events = POLLIN, .revents = 0};
  if (::poll(&wait, 1, left_ms(Clock::now() + patience)) <= 0) return {};
  std::array<char, 65536> bytes{};
  const ssize_t size = ::recv(handle_, bytes.data(), bytes.size(), 0);
  return size > 0 ? std::string(bytes.data(), static_cast<std::size_t>(size)) : std::string{};
}

bool Socket::is_closed_within(Duration patience) {
  const auto end = Clock::now() + patience;
  while (Clock::now() < end) {
    pollfd wait{.fd = handle_, .events = POLLIN, .revents = 0};
    if (::poll(&wait, 1, left_ms(end)) <= 0) return false;
    std::array<char, 65536> bytes{};
    if (::recv(handle_, bytes.data(), bytes.size(), 0) <= 0) return true;
  }
  return false;
}

std::string http(std::uint16_t port, const std::string& request_line, const std::string& headers) {
  Socket socket(port);
  const std::string host = headers.find("Host:") == std::string::npos ? host_of(port) : "";
  socket.send(request_line + "\r\n" + host + headers + "Connection: close\r\n\r\n");
  std::string answer;
  for (std::string part; !(part = socket.receive(kAnswerPatience)).empty();)
    answer += part;
  return answer;
}

std::string status_of(const std::string& answer) {
  return answer.starts_with("HTTP/1.1 ") ? answer.substr(9, 3) : std::string{};
}

int WebFrame::close_code() const noexcept {
  if (opcode != 8 || payload.size() < 2) return 0;
  return static_cast<unsigned char>(payload[0]) * 256 + static_cast<unsigned char>(payload[1]);
}

WebClient::WebClient(std::uint16_t port, const Options& options) : socket_(port) {
  const std::string subprotocol =
      options.subprotocol.empty() ? "" : "Sec-WebSocket-Protocol: " + options.subprotocol + "\r\n";
  const std::string host = options.headers.find("Host:") == std::string::npos ? host_of(port) : "";
  socket_.send("GET " + options.target + " HTTP/1.1\r\n" + host +
               "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
               "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
               subprotocol + options.headers + "\r\n");
  while (received_.find("\r\n\r\n") == std::string::npos) {
    const std::string part = socket_.receive(kAnswerPatience);
    if (part.empty()) break;
    received_ += part;
  }
  const std::size_t end = received_.find("\r\n\r\n");
  answer_ = received_.substr(0, end);
  received_.erase(0, end == std::string::npos ? end : end + 4);
}

bool WebClient::send(std::uint8_t opcode, std::string_view payload) {
  std::string frame(1, static_cast<char>(0x80 | opcode));
  const bool is_small = payload.size() < 126;
  const bool is_large = payload.size() > 0xffff;
  frame += static_cast<char>(0x80 | (is_small ? payload.size() : is_large ? 127U : 126U));
  for (int shift = is_small ? -8 : is_large ? 56 : 8; shift >= 0; shift -= 8)
    frame += static_cast<char>(payload.size() >> shift & 0xff);
  frame += std::string(4, '\0');  // This mask changes no byte.
  return socket_.send(frame.append(payload));
}

std::optional<WebFrame> WebClient::take_frame() {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(received_[i]); };
  if (received_.size() < 2) return std::nullopt;
  std::size_t head_size = 2;
  std::uint64_t size = byte(1) & 127;
  const std::size_t size_size = size == 126 ? 2 : size == 127 ? 8 : 0;
  if (received_.size() < head_size + size_size) return std::nullopt;
  if (size_size > 0) size = 0;
  for (std::size_t i = 0; i < size_size; ++i)
    size = size << 8 | byte(head_size++);
  if (received_.size() < head_size + size) return std::nullopt;
  WebFrame frame{static_cast<std::uint8_t>(byte(0) & 15), received_.substr(head_size, size)};
  received_.erase(0, head_size + size);
  return frame;
}

std::optional<WebFrame> WebClient::next(Duration patience) {
  const auto end = Clock::now() + patience;
  while (true) {
    if (auto frame = take_frame()) {
      if (frame->opcode != 9) return frame;
      send(10, frame->payload);
      continue;
    }
    const std::string part = socket_.receive(end - Clock::now());
    if (part.empty()) return std::nullopt;
    received_ += part;
  }
}

}  // namespace rtpm::system_test
