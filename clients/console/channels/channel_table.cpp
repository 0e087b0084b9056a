#include "channels/channel_table.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace rtpm::console {
namespace {

/// The number of channels in one advertisement.
constexpr std::size_t kBatchSize = 100;

bool is_same(const foxglove::ChannelInfo& a, const foxglove::ChannelInfo& b) {
  return a.encoding == b.encoding && a.schema_name == b.schema_name && a.schema == b.schema &&
         a.schema_encoding == b.schema_encoding;
}

}  // namespace

std::uint32_t ChannelTable::add(foxglove::ChannelInfo channel) {
  if (const std::uint32_t known = find(channel.topic); known != 0) {
    if (is_same(channels_[known].info, channel)) return known;
    remove(channel.topic);
  }
  channel.id = ++last_id_;
  ids_[channel.topic] = channel.id;
  clients_.broadcast(foxglove::advertise(std::array{channel}));
  channels_[last_id_].info = std::move(channel);
  return last_id_;
}

void ChannelTable::remove(const std::string& topic) {
  const std::uint32_t id = find(topic);
  if (id == 0) return;
  for (const auto& [connection, subscription] : channels_[id].subscribers) {
    if (Client* const client = clients_.find(connection)) client->subscriptions.erase(subscription);
  }
  channels_.erase(id);
  ids_.erase(topic);
  clients_.broadcast(foxglove::unadvertise(std::array{id}));
}

std::uint32_t ChannelTable::find(const std::string& topic) const {
  const auto found = ids_.find(topic);
  return found == ids_.end() ? 0 : found->second;
}

bool ChannelTable::has_subscriber(std::uint32_t channel_id) const {
  const auto found = channels_.find(channel_id);
  return found != channels_.end() && !found->second.subscribers.empty();
}

std::vector<std::string> ChannelTable::topics() const {
  std::vector<std::string> topics;
  for (const auto& [topic, id] : ids_)
    topics.push_back(topic);
  return topics;
}

std::map<std::string, std::vector<std::uint64_t>> ChannelTable::subscribers() const {
  std::map<std::string, std::vector<std::uint64_t>> all;
  for (const auto& [id, channel] : channels_) {
    for (const auto& [connection, subscription] : channel.subscribers)
      all[channel.info.topic].push_back(connection);
  }
  return all;
}

void ChannelTable::advertise_to(Client& client) const {
  std::vector<foxglove::ChannelInfo> batch;
  const auto send = [&] {
    client.connection->send_text(std::make_shared<const std::string>(foxglove::advertise(batch)));
    batch.clear();
  };
  for (const auto& [id, channel] : channels_) {
    batch.push_back(channel.info);
    if (batch.size() == kBatchSize) send();
  }
  // Even an empty advertisement is sent, because clients wait for it.
  if (!batch.empty() || channels_.empty()) send();
}

std::vector<std::string> ChannelTable::subscribe(Client& client,
                                                 const foxglove::Subscribe& request) {
  std::vector<std::string> faults;
  const std::uint64_t connection = client.connection->id();
  for (const foxglove::Subscription& one : request.subscriptions) {
    const auto channel = channels_.find(one.channel_id);
    if (channel == channels_.end()) {
      faults.push_back("there is no channel " + std::to_string(one.channel_id));
    } else if (client.subscriptions.contains(one.id)) {
      faults.push_back("subscription " + std::to_string(one.id) + " is in use");
    } else if (channel->second.subscribers.contains(connection)) {
      faults.push_back("channel " + std::to_string(one.channel_id) + " is subscribed already");
    } else {
      client.subscriptions[one.id] = one.channel_id;
      channel->second.subscribers[connection] = one.id;
    }
  }
  return faults;
}

std::vector<std::string> ChannelTable::unsubscribe(Client& client,
                                                   const foxglove::Unsubscribe& request) {
  std::vector<std::string> faults;
  for (const std::uint32_t id : request.subscription_ids) {
    const auto found = client.subscriptions.find(id);
    if (found == client.subscriptions.end()) {
      faults.push_back("there is no subscription " + std::to_string(id));
      continue;
    }
    channels_[found->second].subscribers.erase(client.connection->id());
    client.subscriptions.erase(found);
  }
  return faults;
}

void ChannelTable::remove_client(Client& client) {
  for (const auto& [subscription, channel] : client.subscriptions)
    channels_[channel].subscribers.erase(client.connection->id());
  client.subscriptions.clear();
}

void ChannelTable::publish(std::uint32_t channel_id, std::uint64_t log_time_ns,
                           std::string payload) {
  const auto channel = channels_.find(channel_id);
  if (channel == channels_.end() || channel->second.subscribers.empty()) return;
  const auto shared = std::make_shared<const std::string>(std::move(payload));
  // A send may disconnect a client, which changes the list of subscribers.
  const auto subscribers = channel->second.subscribers;
  for (const auto& [connection, subscription] : subscribers) {
    if (Client* const client = clients_.find(connection)) {
      client->connection->send_message(subscription, log_time_ns, shared);
    }
  }
}

void ChannelTable::publish_picture(std::uint32_t channel_id, std::uint64_t log_time_ns,
                                   std::string payload, bool is_key) {
  const auto channel = channels_.find(channel_id);
  if (channel == channels_.end() || channel->second.subscribers.empty()) return;
  const auto shared = std::make_shared<const std::string>(std::move(payload));
  const auto subscribers = channel->second.subscribers;
  for (const auto& [connection, subscription] : subscribers) {
    if (Client* const client = clients_.find(connection)) {
      client->connection->send_picture(subscription, log_time_ns, shared, is_key);
    }
  }
}

void ChannelTable::publish_to(std::uint64_t connection_id, std::uint32_t channel_id,
                              std::uint64_t log_time_ns, std::string payload) {
  const auto channel = channels_.find(channel_id);
  if (channel == channels_.end()) return;
  const auto subscriber = channel->second.subscribers.find(connection_id);
  Client* const client = clients_.find(connection_id);
  if (client == nullptr || subscriber == channel->second.subscribers.end()) return;
  client->connection->send_message(subscriber->second, log_time_ns,
                                   std::make_shared<const std::string>(std::move(payload)));
}

}  // namespace rtpm::console
