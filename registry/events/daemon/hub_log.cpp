#include "hub_log.hpp"

#include <string>

namespace rtpm::eventd {

void HubLog::write_changes() {
  for (const events::Disconnect& each : hub_.disconnects(disconnect_number_)) {
    if (each.number > disconnect_number_ + 1) {
      log_.write(std::to_string(each.number - disconnect_number_ - 1) +
                 " more consumers disconnected");
    }
    disconnect_number_ = each.number;
    if (each.reason == events::DisconnectReason::kUnsubscribed) continue;
    log_.write("consumer '" + each.name + "' was dropped: " + std::string(to_string(each.reason)));
  }
  const auto links = hub_.links();
  link_states_.resize(links.size(), events::LinkState::kConnecting);
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (links[i].state == link_states_[i]) continue;
    link_states_[i] = links[i].state;
    log_.write("link to '" + links[i].target + "': " + std::string(to_string(links[i].state)) +
               (links[i].reason.empty() ? "" : ": ") + links[i].reason);
  }
  log_.tick();
}

}  // namespace rtpm::eventd
