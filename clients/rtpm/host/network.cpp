#include "host/network.hpp"

#include <array>
#include <cstring>
#include <string>

#include "rtpm/base/printable.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/network_survey.hpp"
#include "rtpm/transport/address.hpp"
#include "rtpm/transport/loopback.hpp"
#include "rtpm/transport/multicast.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

using rt::MulticastTrial;

constexpr Duration kMulticastPatience = std::chrono::milliseconds{500};

/// Uses a port of the dynamic range, so that no consumer of events receives the datagram.
transport::MulticastGroup trial_group() {
  transport::MulticastGroup group;
  group.port = static_cast<std::uint16_t>(0xc000U | (rt::random_u64() & 0x3fffU));
  group.hops = 0;  // The datagram stays on this host.
  return group;
}

MulticastTrial send_and_await(transport::MulticastSender& sender,
                              transport::MulticastReceiver& receiver) {
  std::array<std::byte, 8> sent{};
  const std::uint64_t number = rt::random_u64();
  std::memcpy(sent.data(), &number, sizeof number);
  if (!sender.send(sent)) return MulticastTrial::kNotSent;
  std::array<std::byte, 64> buffer{};
  for (const MonotonicTime end = rt::now() + kMulticastPatience; receiver.wait(end);) {
    const ConstBytes received = receiver.receive(buffer);
    const bool is_ours = received.size() == sent.size() &&
                         std::memcmp(received.data(), sent.data(), sent.size()) == 0;
    if (is_ours) return MulticastTrial::kReceived;
  }
  return MulticastTrial::kNotReceived;
}

rt::Finding survey_multicast() {
  const transport::MulticastGroup group = trial_group();
  rt::MulticastFacts facts = rt::read_multicast("", group.group);
  auto receiver = transport::MulticastReceiver::open(group);
  auto sender = transport::MulticastSender::open(group);
  if (receiver && sender) {
    facts.trial = send_and_await(*sender, *receiver);
  } else {
    facts.trial = MulticastTrial::kRefused;
    facts.reason = (receiver ? sender.error() : receiver.error()).reason();
  }
  return judge_multicast(facts);
}

bool answers_as_rtpm(Context& context, std::uint16_t port) {
  wire::Url url{.hosts = {"127.0.0.1"}, .port = port, .path = std::string(introspection::kPath)};
  for (const transport::InterfaceAddress& own : transport::own_addresses()) {
    const transport::SocketAddress& address = own.address;
    const bool is_other = !address.is_link_local() && address.host() != url.hosts.front();
    if (is_other && url.hosts.size() < wire::kUrlHostCountMax) url.hosts.push_back(address.host());
  }
  const auto bound = introspection::IntrospectionClient::bind(context.node(), url.text());
  return bound || bound.error().cause == rpc::CallError::kNoSuchObject;
}

/// The addresses at which other hosts reach a server with --host any.
rt::Finding survey_addresses() {
  rt::Finding finding{.id = "addresses"};
  if (const char* const remedy = transport::remedy_for_loopback()) {
    finding.severity = rt::Severity::kProblem;
    finding.text = "the loopback interface is down";
    finding.cost = "programs of this host do not reach each other";
    finding.remedy = remedy;
    return finding;
  }
  for (const transport::InterfaceAddress& own : transport::own_addresses()) {
    const transport::SocketAddress& address = own.address;
    if (address.is_loopback() || address.is_link_local()) continue;
    finding.text += (finding.text.empty() ? "this host has " : ", ") + address.host() + " (" +
                    printable(own.interface) + ")";
  }
  if (!finding.text.empty()) return finding;
  finding.severity = rt::Severity::kNote;
  finding.text = "this host has no address but its loopback ones";
  finding.cost = "programs of other hosts do not reach its servers";
  finding.remedy = "give it a network, if they shall";
  return finding;
}

rt::Finding survey_port(Context& context, std::uint16_t port, std::string program) {
  rt::PortFacts facts{.port = port, .program = std::move(program), .option = "--port"};
  facts.holder = rt::holder_of_port("", port);
  if (facts.holder) facts.answers = answers_as_rtpm(context, port);
  return judge_port(facts);
}

}  // namespace

std::vector<rt::Finding> survey_network(Context& context) {
  return {survey_addresses(), survey_multicast(),
          survey_port(context, names::kDefaultRegistryPort, "rtpm-registryd"),
          survey_port(context, events::kDefaultHubPort, "rtpm-eventd")};
}

}  // namespace rtpm::tool
