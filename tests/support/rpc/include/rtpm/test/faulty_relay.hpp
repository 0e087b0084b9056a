#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "rtpm/test/sockets.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::test {

/// A bad network between a caller and a server: it loses, repeats, delays and reorders datagrams in
/// both directions, by a seed. Its faults look like those of a real network, but repeat exactly for
/// the same seed.
/// Threads: the relay runs on a thread of its own.
class FaultyRelay {
 public:
  struct Faults {
    double loss = 0.05;
    double repetition = 0.05;
    double delay = 0.10;  ///< A datagram is held until the next one has gone.
    std::uint64_t seed = 1;
    /// The datagrams that an attacker sends to a client before a datagram of its server.
    std::function<std::vector<std::vector<char>>(const std::vector<char>& datagram)> forge{};
  };

  FaultyRelay(std::uint16_t server_port, const Faults& faults)
      : server_(address_of(server_port)), faults_(faults), random_(faults.seed) {
    front_ = open_socket();
    sockaddr_in own = address_of(0);
    static_cast<void>(bind(front_.number(), as_any(own), sizeof own));
    socklen_t size = sizeof own;
    getsockname(front_.number(), as_any(own), &size);
    port_ = ntohs(own.sin_port);
    thread_ = std::thread([this] { run(); });
  }
  FaultyRelay(const FaultyRelay&) = delete;
  FaultyRelay& operator=(const FaultyRelay&) = delete;
  ~FaultyRelay() {
    is_stopping_ = true;
    thread_.join();
  }

  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  /// The number of datagrams that it lost.
  [[nodiscard]] int lost_count() const noexcept { return lost_count_.load(); }

 private:
  struct Client {
    sockaddr_in address{};
    transport::Descriptor to_server;
  };
  struct Datagram {
    std::size_t client = 0;
    bool is_to_server = false;
    std::vector<char> bytes;
  };

  static sockaddr* as_any(sockaddr_in& address) { return reinterpret_cast<sockaddr*>(&address); }
  static sockaddr_in address_of(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(port);
    return address;
  }
  static transport::Descriptor open_socket() {
    return transport::Descriptor(test::open_socket(AF_INET, SOCK_DGRAM));
  }

  void run() {
    std::array<char, 2048> room{};
    while (!is_stopping_) {
      std::vector<pollfd> waiting{{front_.number(), POLLIN, 0}};
      for (const Client& client : clients_)
        waiting.push_back({client.to_server.number(), POLLIN, 0});
      constexpr int kPatienceMs = 2;
      if (poll(waiting.data(), waiting.size(), kPatienceMs) == 0 && held_) {
        pass(*std::exchange(held_, std::nullopt));
      }
      sockaddr_in from{};
      socklen_t from_size = sizeof from;
      ssize_t size = 0;
      while ((size = recvfrom(front_.number(), room.data(), room.size(), 0, as_any(from),
                              &from_size)) > 0) {
        take({client_of(from), true, {room.data(), room.data() + size}});
      }
      for (std::size_t i = 0; i < clients_.size(); ++i) {
        while ((size = recv(clients_[i].to_server.number(), room.data(), room.size(), 0)) > 0) {
          take({i, false, {room.data(), room.data() + size}});
        }
      }
    }
  }

  std::size_t client_of(const sockaddr_in& from) {
    for (std::size_t i = 0; i < clients_.size(); ++i) {
      if (clients_[i].address.sin_port == from.sin_port) return i;
    }
    Client client{from, open_socket()};
    static_cast<void>(connect(client.to_server.number(), as_any(server_), sizeof server_));
    clients_.push_back(std::move(client));
    return clients_.size() - 1;
  }

  bool happens(double chance) { return std::uniform_real_distribution<>(0, 1)(random_) < chance; }

  void take(Datagram datagram) {
    if (happens(faults_.loss)) {
      ++lost_count_;
      return;
    }
    if (happens(faults_.repetition)) pass(datagram);
    if (!held_ && happens(faults_.delay)) {
      held_ = std::move(datagram);
      return;
    }
    pass(datagram);
    if (held_) pass(*std::exchange(held_, std::nullopt));
  }

  void pass(const Datagram& datagram) {
    Client& client = clients_[datagram.client];
    if (!datagram.is_to_server && faults_.forge) {
      for (const std::vector<char>& forged : faults_.forge(datagram.bytes)) {
        static_cast<void>(sendto(front_.number(), forged.data(), forged.size(), 0,
                                 as_any(client.address), sizeof client.address));
      }
    }
    const auto size =
        datagram.is_to_server
            ? send(client.to_server.number(), datagram.bytes.data(), datagram.bytes.size(), 0)
            : sendto(front_.number(), datagram.bytes.data(), datagram.bytes.size(), 0,
                     as_any(client.address), sizeof client.address);
    static_cast<void>(size);  // A datagram that can't be sent is one more loss.
  }

  sockaddr_in server_;
  Faults faults_;
  std::mt19937_64 random_;
  transport::Descriptor front_;
  std::uint16_t port_ = 0;
  std::vector<Client> clients_;
  std::optional<Datagram> held_;
  std::atomic<int> lost_count_{0};
  std::atomic<bool> is_stopping_{false};
  std::thread thread_;
};

}  // namespace rtpm::test
