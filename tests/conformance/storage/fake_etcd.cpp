#include "fake_etcd.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdlib>

namespace rtpm::storage_test {
namespace {

/// Reads the path and body of a request; false if the connection ended.
bool read_request(int connection, std::string& path, std::string& body) {
  std::string text;
  std::array<char, 4096> part{};
  std::size_t head = std::string::npos;
  std::size_t size = 0;
  while (head == std::string::npos || text.size() < head + 4 + size) {
    const auto count = ::recv(connection, part.data(), part.size(), 0);
    if (count <= 0) return false;
    text.append(part.data(), static_cast<std::size_t>(count));
    head = text.find("\r\n\r\n");
    const std::size_t length = text.find("Content-Length: ");
    if (length < head) size = static_cast<std::size_t>(std::atoi(text.c_str() + length + 16));
  }
  path = text.substr(5, text.find(' ', 5) - 5);
  body = text.substr(head + 4);
  return true;
}

}  // namespace

FakeEtcd::FakeEtcd(Handler handler) : handler_(std::move(handler)) {
  listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), size);
  ::listen(listener_, 16);
  ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
  port_ = ntohs(address.sin_port);
  thread_ = std::thread([this] { run(); });
}

FakeEtcd::~FakeEtcd() {
  is_ending_ = true;
  ::shutdown(listener_, SHUT_RDWR);
  thread_.join();
  {
    const std::lock_guard lock(mutex_);
    for (const int connection : open_)
      ::shutdown(connection, SHUT_RDWR);
  }
  for (std::thread& each : threads_)
    each.join();
  ::close(listener_);
}

std::string FakeEtcd::endpoint() const {
  return "127.0.0.1:" + std::to_string(port_);
}

void FakeEtcd::run() {
  while (!is_ending_) {
    const int connection = ::accept(listener_, nullptr, nullptr);
    if (connection < 0) return;
    {
      const std::lock_guard lock(mutex_);
      open_.push_back(connection);
    }
    threads_.emplace_back([this, connection] { serve(connection); });
  }
}

void FakeEtcd::serve(int connection) {
  std::string path;
  std::string body;
  if (read_request(connection, path, body)) {
    const std::string reply = handler_(path, body);
    if (reply.empty()) {
      char ignored = 0;
      static_cast<void>(::recv(connection, &ignored, 1, 0));  // The other side gives up.
    } else {
      const std::string text = "HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Length: " +
                               std::to_string(reply.size()) + "\r\n\r\n" + reply;
      static_cast<void>(::send(connection, text.data(), text.size(), MSG_NOSIGNAL));
    }
  }
  const std::lock_guard lock(mutex_);
  open_.remove(connection);
  ::close(connection);
}

}  // namespace rtpm::storage_test
