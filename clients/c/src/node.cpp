#include "node.hpp"

#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "guard.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/directory.hpp"

namespace {

using namespace rtpm;

std::optional<rpc::Transport> transport_of(std::string_view name) {
  for (const auto transport : {rpc::Transport::kAuto, rpc::Transport::kUdp, rpc::Transport::kTcp,
                               rpc::Transport::kSharedMemory}) {
    if (rpc::to_string(transport) == name) return transport;
  }
  return std::nullopt;
}

/// The text, else that of the environment, else `otherwise`.
std::string text_or(const char* text, const char* variable, std::string_view otherwise) {
  if (text == nullptr) text = std::getenv(variable);
  return std::string(text == nullptr || *text == '\0' ? otherwise : text);
}

}  // namespace

rtpm_status rtpm_node_open(const rtpm_node_options* options, rtpm_node** node) {
  return c::guarded([&] {
    if (node == nullptr) return c::invalid("rtpm_node_open: node is NULL");
    const auto wanted = c::options_of(options, rtpm_node_options RTPM_NODE_OPTIONS_INIT);
    const char* const name = wanted.transport == nullptr ? "auto" : wanted.transport;
    const auto transport = transport_of(name);
    if (!transport) {
      return c::invalid("transport takes auto, udp, tcp or shm, not '" + printable(name, 64) + "'");
    }
    rpc::NodeConfig config;
    config.transport = *transport;
    config.security.key_file = text_or(wanted.key_file, "RTPM_KEY", "");
    config.security.known_servers_file =
        text_or(wanted.known_servers_file, "RTPM_KNOWN_SERVERS", "");
    *node = std::make_unique<rtpm_node>(text_or(wanted.registry, "RTPM_REGISTRY", names::kThisHost),
                                        std::move(config))
                .release();
    return rtpm_status{RTPM_OK};
  });
}

void rtpm_node_close(rtpm_node* node) {
  delete node;
}

rtpm_status rtpm_node_names(rtpm_node* node, const char* directory, char** json) {
  return c::guarded([&] {
    if (node == nullptr || json == nullptr)
      return c::invalid("rtpm_node_names: node and json must not be NULL");
    auto found = names::Directory(node->node, node->where).list(directory ? directory : "");
    if (!found) return c::failed(SetupError(std::move(found.error())), RTPM_UNREACHABLE);
    auto list = nlohmann::ordered_json::array();
    for (const names::NameEntry& entry : *found)
      list.push_back({{"name", entry.name}, {"interface", entry.interface}, {"url", entry.url}});
    return c::give_text(list.dump(), json);
  });
}
