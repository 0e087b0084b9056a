// A supplier or a consumer as a process of its own, for the tests of whole systems.
//   events-peer supply REGISTRY HUB    pushes an event of type 5 each millisecond, for ever
//   events-peer consume REGISTRY HUB ring|stream   prints a line for each event and each notice
#include <chrono>
#include <cstdio>
#include <cstring>
#include <string>

#include "rtpm/events/consumer.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"

namespace {

using namespace std::chrono_literals;
using namespace rtpm::events;

constexpr EventType kTick = 5;

class Printer final : public EventHandler {
 public:
  void on_events(std::span<const EventView> events) override {
    std::printf("event %llu\n", static_cast<unsigned long long>(events[0].header.sequence));
    std::fflush(stdout);
  }
  void on_notice(const Notice& notice) override {
    switch (notice.kind) {
      case NoticeKind::kSubscribed:
        std::printf("subscribed\n");
        break;
      case NoticeKind::kLosses:
        std::printf("losses %llu\n", static_cast<unsigned long long>(notice.losses.total()));
        break;
      case NoticeKind::kResubscribed:
        std::printf("resubscribed%s\n", notice.has_hub_restarted ? " to another life" : "");
        break;
      case NoticeKind::kInterrupted:
        std::printf("interrupted: %s\n", std::string(notice.text).c_str());
        break;
      default:
        std::printf("notice %d\n", static_cast<int>(notice.kind));
    }
    std::fflush(stdout);
  }
};

int fail(const std::string& text) {
  std::fprintf(stderr, "events-peer: %s\n", text.c_str());
  return 1;
}

int supply(rtpm::rpc::Node& node, const std::string& hub) {
  const rtpm::program::StopSignal stop;
  auto supplier = Supplier::create(node, hub, {.deadline = 10s});
  if (!supplier) return fail(supplier.error().text());
  std::printf("supplying\n");
  std::fflush(stdout);
  std::uint64_t pushed = 0;
  std::uint64_t failed = 0;
  while (!stop.wait_for(1ms)) {
    // Pushes fail without a hub, but another one may start.
    ++((*supplier)->push({.type = kTick}) ? pushed : failed);
  }
  const auto counters = (*supplier)->counters();
  std::printf("pushed %llu failed %llu maybe lost %llu\n", static_cast<unsigned long long>(pushed),
              static_cast<unsigned long long>(failed),
              static_cast<unsigned long long>(counters.maybe_lost_count));
  return 0;
}

int consume(rtpm::rpc::Node& node, const std::string& hub, bool shared_ring) {
  const rtpm::program::StopSignal stop;
  Printer printer;
  auto consumer = Consumer::create(
      node, hub,
      {.filter = of_type(kTick),
       // Holds seconds of events: a busy machine may delay a time-shared process that long.
       .delivery = {.queue_capacity = kQueueCapacityMax},
       .realtime = rtpm::rt::RealtimeMode::kOff,
       .shared_ring = shared_ring,
       .deadline = 10s},
      printer);
  if (!consumer) return fail(consumer.error().text());
  if ((*consumer)->reads_ring() != shared_ring) return fail("it does not read what it shall");
  stop.wait();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return fail("what, registry and hub?");
  rtpm::rpc::Node node;
  rtpm::names::RegistryResolver resolver(node, argv[2]);
  node.use(resolver);
  if (std::strcmp(argv[1], "supply") == 0) return supply(node, argv[3]);
  return consume(node, argv[3], argc > 4 && std::strcmp(argv[4], "ring") == 0);
}
