#include "hub_log.hpp"

#include <cstdio>
#include <string>

namespace rtpm::eventd {

void HubLog::tell() {
  for (const events::Departure& each : hub_.departures(departure_number_)) {
    if (each.number > departure_number_ + 1) {
      std::fprintf(stderr, "rtpm-eventd: %llu more consumers went\n",
                   static_cast<unsigned long long>(each.number - departure_number_ - 1));
    }
    departure_number_ = each.number;
    if (each.reason == events::DepartureReason::kUnsubscribed) continue;
    std::fprintf(stderr, "rtpm-eventd: consumer '%s' was dropped: %s\n", each.name.c_str(),
                 std::string(to_string(each.reason)).c_str());
  }
  const auto links = hub_.links();
  link_states_.resize(links.size(), events::LinkState::kConnecting);
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (links[i].state == link_states_[i]) continue;
    link_states_[i] = links[i].state;
    std::fprintf(stderr, "rtpm-eventd: link to '%s': %s%s%s\n", links[i].target.c_str(),
                 std::string(to_string(links[i].state)).c_str(),
                 links[i].reason.empty() ? "" : ": ", links[i].reason.c_str());
  }
}

}  // namespace rtpm::eventd
