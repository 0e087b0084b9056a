#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <string>
#include <utility>

#include "rtpm/base/bytes.hpp"

namespace rtpm::bench {

[[nodiscard]] inline sockaddr_in address_of(const std::string& host, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = inet_addr(host.c_str());
  return address;
}

/// A socket of the raw floors: system calls alone. Owns its descriptor.
class RawSocket {
 public:
  /// `type`: SOCK_DGRAM or SOCK_STREAM.
  static RawSocket open(int type) { return RawSocket(::socket(AF_INET, type, 0)); }
  explicit RawSocket(int handle) noexcept : handle_(handle) {}
  RawSocket(RawSocket&& other) noexcept : handle_(std::exchange(other.handle_, -1)) {}
  RawSocket& operator=(RawSocket&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~RawSocket() {
    if (handle_ >= 0) ::close(handle_);
  }
  [[nodiscard]] int handle() const noexcept { return handle_; }

  [[nodiscard]] bool bind(const std::string& host) const noexcept {
    const sockaddr_in address = address_of(host, 0);
    return ::bind(handle_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  [[nodiscard]] bool connect(const sockaddr_in& to) const noexcept {
    return ::connect(handle_, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  }
  [[nodiscard]] std::uint16_t port() const noexcept {
    sockaddr_in address{};
    socklen_t size = sizeof address;
    ::getsockname(handle_, reinterpret_cast<sockaddr*>(&address), &size);
    return ntohs(address.sin_port);
  }
  /// Sets the time after which a blocked receive gives up.
  void set_patience(timeval patience) const noexcept {
    ::setsockopt(handle_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  }
  /// `to` is null if the socket is connected.
  bool send(ConstBytes bytes, const sockaddr_in* to = nullptr) const noexcept {
    return ::sendto(handle_, bytes.data(), bytes.size(), MSG_NOSIGNAL,
                    reinterpret_cast<const sockaddr*>(to), to == nullptr ? 0 : sizeof *to) >= 0;
  }
  /// @return as recv() does
  ssize_t receive(MutableBytes bytes, int flags, sockaddr_in* from = nullptr) const noexcept {
    if (from == nullptr) return ::recv(handle_, bytes.data(), bytes.size(), flags);
    socklen_t size = sizeof *from;
    return ::recvfrom(handle_, bytes.data(), bytes.size(), flags, reinterpret_cast<sockaddr*>(from),
                      &size);
  }

 private:
  int handle_;
};

}  // namespace rtpm::bench
