#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "foxglove/replies.hpp"
#include "web/connection.hpp"

namespace rtpm::console {

/// A connection's subscriptions and requests.
struct Client {
  Connection* connection = nullptr;
  std::map<std::uint32_t, std::uint32_t> subscriptions{};  ///< Maps subscriptions to channels.
  bool watches_graph = false;
  bool watches_all_parameters = false;
  std::set<std::string> watched_parameters{};
  std::size_t open_call_count = 0;
  std::size_t garbage_count = 0;  ///< Consecutive malformed frames.

  [[nodiscard]] bool watches(const std::string& parameter) const {
    return watches_all_parameters || watched_parameters.contains(parameter);
  }
};

/// All connections.
/// @threads  the web server's thread
class Clients {
 public:
  Client& add(Connection& connection) {
    Client& client = clients_[connection.id()];
    client.connection = &connection;
    return client;
  }
  void remove(std::uint64_t id) {
    const auto found = clients_.find(id);
    if (found == clients_.end()) return;
    left_dropped_count_ += found->second.connection->dropped_count();
    clients_.erase(found);
  }
  /// The client with this id; nullptr if it has disconnected.
  [[nodiscard]] Client* find(std::uint64_t id) {
    const auto found = clients_.find(id);
    return found == clients_.end() ? nullptr : &found->second;
  }
  [[nodiscard]] std::size_t count() const noexcept { return clients_.size(); }
  [[nodiscard]] std::uint64_t dropped_count() const {
    std::uint64_t count = left_dropped_count_;
    for (const auto& [id, client] : clients_)
      count += client.connection->dropped_count();
    return count;
  }

  /// Calls `visit` for each connected client; `visit` may disconnect clients.
  void for_each(const std::function<void(Client&)>& visit) {
    for (auto next = clients_.begin(); next != clients_.end();) {
      const std::uint64_t id = next->first;
      visit(next->second);
      next = clients_.upper_bound(id);
    }
  }
  void broadcast(std::string text) {
    const auto shared = std::make_shared<const std::string>(std::move(text));
    for_each([&](Client& client) { client.connection->send_text(shared); });
  }
  void send(std::uint64_t id, std::string text) {
    if (Client* const client = find(id)) {
      client->connection->send_text(std::make_shared<const std::string>(std::move(text)));
    }
  }
  void send_binary(std::uint64_t id, std::string bytes) {
    if (Client* const client = find(id)) {
      client->connection->send_binary(std::make_shared<const std::string>(std::move(bytes)));
    }
  }
  void send_status(std::uint64_t id, foxglove::StatusLevel level, std::string_view message) {
    send(id, foxglove::status(level, message));
  }

 private:
  std::map<std::uint64_t, Client> clients_{};
  std::uint64_t left_dropped_count_ = 0;
};

}  // namespace rtpm::console
