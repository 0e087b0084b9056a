#include <algorithm>
#include <string>
#include <vector>

#include "holder_remedies.hpp"
#include "rtpm/rt/network_survey.hpp"

namespace rtpm::rt {
namespace {

std::string names_of(const std::vector<InterfaceFacts>& interfaces) {
  std::string names;
  for (const InterfaceFacts& facts : interfaces) {
    if (facts.is_up && !facts.is_loopback) names += (names.empty() ? "" : ", ") + facts.name;
  }
  return names;
}

constexpr const char* kMulticastCost =
    "hubs can't send events to many consumers at once (rtpm-eventd --multicast): each consumer "
    "takes a stream of its own; calls and all else are not affected";

Finding lacking_multicast(std::string text, std::string remedy) {
  return {"multicast", Severity::kNote, std::move(text), kMulticastCost, std::move(remedy)};
}

std::string failure_of(const MulticastFacts& facts) {
  return facts.trial == MulticastTrial::kNotSent
             ? "a datagram to " + facts.group + " can't be sent"
             : "a datagram to " + facts.group + " did not come back within 0.5 s";
}

// All there is to judge where the system does not tell its interfaces.
Finding judge_trial(const MulticastFacts& facts) {
  if (facts.trial == MulticastTrial::kReceived) {
    return {"multicast", Severity::kGood, "a datagram to " + facts.group + " comes back"};
  }
  return lacking_multicast(
      facts.trial == MulticastTrial::kRefused ? facts.reason : failure_of(facts),
      "give the host a network that has multicast, and let its firewall pass it");
}

}  // namespace

Finding judge_multicast(const MulticastFacts& facts) {
  if (facts.interfaces.empty()) return judge_trial(facts);
  const auto is_ready_loopback = [](const InterfaceFacts& each) {
    return each.is_loopback && each.is_up;
  };
  const bool is_refused = facts.trial == MulticastTrial::kRefused;
  if (is_refused && std::ranges::none_of(facts.interfaces, is_ready_loopback)) {
    return lacking_multicast(facts.reason, "sudo ip link set dev lo up");
  }
  const auto route = std::ranges::find(facts.interfaces, facts.route, &InterfaceFacts::name);
  if (facts.route.empty() || route == facts.interfaces.end()) {
    const std::string names = names_of(facts.interfaces);
    const std::string first = names.empty() ? "lo" : names.substr(0, names.find(','));
    return lacking_multicast("no route leads to " + facts.group,
                             "sudo ip route add 239.0.0.0/8 dev " + first);
  }
  if (!route->has_multicast) {
    return lacking_multicast(
        "the interface for " + facts.group + ", " + route->name + ", has multicast switched off",
        "sudo ip link set dev " + route->name + " multicast on");
  }
  if (!route->is_up) {
    return lacking_multicast("the interface for " + facts.group + ", " + route->name + ", is down",
                             "sudo ip link set dev " + route->name + " up");
  }
  if (is_refused) {
    return lacking_multicast(facts.reason, "see which system calls are allowed here");
  }
  if (facts.trial != MulticastTrial::kReceived) {
    return lacking_multicast(failure_of(facts),
                             "look for a rule that drops it: sudo nft list ruleset");
  }
  return {"multicast", Severity::kGood,
          "a datagram to " + facts.group + " comes back; it goes by " + route->name};
}

Finding judge_port(const PortFacts& facts) {
  const std::string port = std::to_string(facts.port);
  Finding finding{.id = "port-" + port};
  if (facts.answers) {
    finding.text = "a server of RTPM has it, " + facts.program + "'s default";
    return finding;
  }
  if (!facts.holder) {
    finding.text = "it is free for " + facts.program;
    return finding;
  }
  const bool is_known = facts.holder->process_id != 0;
  finding.severity = Severity::kWarning;
  finding.text = (is_known ? "'" + facts.holder->program + "' (process " +
                                 std::to_string(facts.holder->process_id) + ")"
                           : std::string("a program of another user")) +
                 " has it by " + facts.holder->transport + " and does not answer as RTPM does";
  finding.cost = facts.program + " does not start there, and programs do not find it by default";
  finding.remedy = (is_known ? os::end_of_process(facts.holder->process_id) + ", or "
                             : os::search_for_holder(port) + " shows it; or ") +
                   facts.program + " " + facts.option + " " + std::to_string(facts.port + 1000);
  return finding;
}

}  // namespace rtpm::rt
