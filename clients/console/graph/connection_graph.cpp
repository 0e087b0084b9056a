#include "graph/connection_graph.hpp"

#include <map>

#include "rtpm/wire/url.hpp"

namespace rtpm::console {
namespace {

constexpr const char* kConsole = "rtpm-console";

std::string server_of(const std::string& url) {
  const auto parts = wire::parse_url(url);
  return parts ? parts->authority() : url;
}

}  // namespace

foxglove::Graph connection_graph(const ChannelTable& channels, const CallRouter& router,
                                 const std::vector<ObjectView>& objects,
                                 const std::set<std::string>& devices) {
  foxglove::Graph graph;
  std::map<std::string, std::string> servers;
  for (const ObjectView& object : objects)
    servers[object.name] = server_of(object.url);
  for (const std::string& topic : channels.topics()) {
    const std::string owner = topic.substr(0, topic.rfind('/'));
    if (devices.contains(owner) && servers.contains(owner)) {
      graph.published_topics[topic] = {servers[owner]};
    } else {
      const bool is_own = topic.starts_with("console/") || topic.starts_with("replay/");
      graph.published_topics[topic] = {is_own ? kConsole : "hub"};
    }
  }
  for (const auto& [topic, connections] : channels.subscribers()) {
    for (const std::uint64_t connection : connections)
      graph.subscribed_topics[topic].insert("browser " + std::to_string(connection));
  }
  for (const std::string& service : router.names()) {
    const auto server = servers.find(service.substr(0, service.rfind('/')));
    graph.services[service] = {server == servers.end() ? kConsole : server->second};
  }
  return graph;
}

}  // namespace rtpm::console
