#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "foxglove/replies.hpp"
#include "foxglove/requests.hpp"
#include "sessions/clients.hpp"

namespace rtpm::console {

/// The advertised channels and their subscribers.
/// @ownership refers to the clients
/// @threads  the web server's thread
class ChannelTable {
 public:
  explicit ChannelTable(Clients& clients) noexcept : clients_(clients) {}

  /// Advertises a channel; replaces one with the same topic and another schema. Chooses the id of
  /// `channel`.
  /// @return the id
  std::uint32_t add(foxglove::ChannelInfo channel);
  void remove(const std::string& topic);
  /// The id of the channel for `topic`; 0 if there is none.
  [[nodiscard]] std::uint32_t find(const std::string& topic) const;
  [[nodiscard]] bool has_subscriber(std::uint32_t channel_id) const;
  [[nodiscard]] std::vector<std::string> topics() const;
  /// The subscribing connections of each topic.
  [[nodiscard]] std::map<std::string, std::vector<std::uint64_t>> subscribers() const;

  /// Sends all channels to a new client.
  void advertise_to(Client& client) const;
  /// @return the errors of channels that could not be subscribed to; empty if there were none. The
  ///         others are subscribed to.
  [[nodiscard]] std::vector<std::string> subscribe(Client& client,
                                                   const foxglove::Subscribe& request);
  [[nodiscard]] std::vector<std::string> unsubscribe(Client& client,
                                                     const foxglove::Unsubscribe& request);
  /// Removes a client that is disconnecting.
  void remove_client(Client& client);

  /// Sends a message to all subscribers; the payload is shared.
  void publish(std::uint32_t channel_id, std::uint64_t log_time_ns, std::string payload);
  /// Sends a picture to all subscribers, like Connection::send_picture().
  void publish_picture(std::uint32_t channel_id, std::uint64_t log_time_ns, std::string payload,
                       bool is_key);
  /// Sends a message to one subscriber.
  void publish_to(std::uint64_t connection_id, std::uint32_t channel_id, std::uint64_t log_time_ns,
                  std::string payload);

 private:
  struct Channel {
    foxglove::ChannelInfo info{};
    std::map<std::uint64_t, std::uint32_t> subscribers{};  ///< Maps connections to subscriptions.
  };
  Clients& clients_;
  std::map<std::uint32_t, Channel> channels_{};
  std::map<std::string, std::uint32_t> ids_{};  ///< Keyed by topic.
  std::uint32_t last_id_ = 0;
};

}  // namespace rtpm::console
