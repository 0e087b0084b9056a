#include "rtpm/events/hub_report.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

#include "idl.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::events {
namespace {

std::string text_of(const flatbuffers::String* text) {
  constexpr std::size_t kTextSizeMax = 64;
  return text == nullptr ? std::string() : printable(text->string_view(), kTextSizeMax);
}

HubConsumer consumer_of(const SubscriptionEntry& entry) {
  HubConsumer consumer{.name = text_of(entry.name()),
                       .program = text_of(entry.program()),
                       .process = entry.process(),
                       .host = text_of(entry.host()),
                       .way = "stream",
                       .age = Duration{entry.age_ns()},
                       .lag = std::max(Duration{entry.lag_ns()}, Duration{0}),
                       .waiting_count = entry.waiting(),
                       .accepted_count = entry.accepted(),
                       .lost_count = involuntary(losses_of(*entry.losses())) + entry.own_lost(),
                       .is_suspended = entry.is_suspended()};
  if (entry.reads_ring()) consumer.way = "ring";
  if (entry.receives_multicast()) consumer.way = "multicast";
  if (entry.is_link()) consumer.way = "hub";
  return consumer;
}

}  // namespace

expected<HubReport, SetupError> HubReport::ask(rpc::Node& node, const std::string& target,
                                               Duration deadline) {
  auto hub = HubClient::bind(node, target, {.deadline = deadline});
  if (!hub) return unexpected{std::move(hub.error())};
  const auto reply = hub->report({}, {.deadline = deadline});
  if (!reply) {
    return setup_error("the report of the hub at " + target + " is not known",
                       rpc::make_error_code(reply.error()));
  }
  HubReport report;
  for (const SubscriptionEntry* entry : *(*reply)->subscriptions())
    report.consumers.push_back(consumer_of(*entry));
  for (const SupplierEntry* entry : *(*reply)->suppliers())
    report.taken_count += entry->counts()->taken();
  std::ranges::sort(report.consumers, [](const HubConsumer& a, const HubConsumer& b) {
    return std::tuple(b.lag, b.lost_count, a.name) < std::tuple(a.lag, a.lost_count, b.name);
  });
  return report;
}

}  // namespace rtpm::events
