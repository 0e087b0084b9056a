#include <unistd.h>

#include <cstdio>
#include <deque>
#include <exception>
#include <future>
#include <mutex>
#include <string_view>
#include <utility>

#include "peer.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/thread.hpp"
#include "runs/peer_link.hpp"
#include "runs/turn.hpp"

// The program of a peer, as rtpm-bench starts it: rtpm-peer-NAME ROLE SETTING. serve and call are the
// two ends of calls, broker and events those of events.
namespace rtpm::bench {
namespace {

/// More than any turn has.
constexpr std::size_t kSampleMax = 65'536;

/// Reports to rtpm-bench that all is well, with the lanes' addresses, or why not; only the first
/// report counts.
void report(const Outcome<std::vector<std::string>>& ready) {
  static std::once_flag once;
  std::call_once(once, [&] {
    const std::string word = ready ? "+" + nlohmann::json(*ready).dump() : "-" + ready.error();
    (void)!write(STDOUT_FILENO, word.data(), word.size());
    close(STDOUT_FILENO);
  });
}

/// Runs code that calls a library, and catches its exceptions.
Outcome<> without_exceptions(const std::function<Outcome<>()>& body) {
  try {
    return kPeer.guard == nullptr ? body() : kPeer.guard(body);
  } catch (const std::exception& error) {
    return failure(std::string(error.what()));
  } catch (...) {
    return failure("an exception of the library's own kind");
  }
}

PeerLane lane_of(const PeerSetting& setting, std::size_t index, int caller = 0) {
  return {.index = index,
          .transport = setting.transport,
          .folder = setting.folder,
          .connection_count = index == 0 ? 1 : setting.low_caller_count,
          .caller = caller,
          .priority = index == 0 ? kHighPriority : kLowPriority};
}

rt::ThreadConfig thread_config(const PeerSetting& setting, std::size_t index, bool is_server) {
  return {.name = index == 0 ? "peer-high" : "peer-low",
          .priority = index == 0 ? kHighPriority : kLowPriority,
          .cpus = {is_server ? setting.placement.server_cpu : setting.placement.client_cpu},
          .realtime = setting.realtime};
}

/// Starts a thread that lives until the process ends.
Outcome<> start_thread(const rt::ThreadConfig& config, std::function<void()> body) {
  auto thread = rt::Thread::start(config, std::move(body));
  if (!thread) return failure(thread.error());
  static_cast<void>(new rt::Thread(std::move(*thread)));
  return {};
}

/// Runs `body` to its end on a thread with the policy, priority and CPU of a lane's callers.
Outcome<> run_as_caller(const PeerSetting& setting, std::size_t index,
                        const std::function<Outcome<>()>& body) {
  Outcome<> outcome;
  auto thread = rt::Thread::start(thread_config(setting, index, false),
                                  [&] { outcome = without_exceptions(body); });
  if (!thread) return failure(thread.error());
  thread->join();
  return outcome;
}

// ---- the server ---------------------------------------------------------------------------------

using Serve = Outcome<> (*)(const PeerLane&, const Announce&);

/// Starts a lane's thread and waits until the lane can be called: at the returned address.
Outcome<std::string> start_lane(const PeerSetting& setting, Serve serve, std::size_t index) {
  auto announced = std::make_shared<std::promise<Outcome<std::string>>>();
  auto is_announced = announced->get_future();
  const auto started = start_thread(thread_config(setting, index, true), [announced, index, serve,
                                                                          &setting] {
    const Announce announce = [&](const std::string& address) { announced->set_value(address); };
    const auto served =
        without_exceptions([&] { return serve(lane_of(setting, index), announce); });
    if (served) return;
    // If it was announced before, its callers' deadlines show that it no longer serves.
    try {
      announced->set_value(failure(served.error()));
    } catch (const std::future_error&) {
      std::fprintf(stderr, "peer: a lane ended: %s\n", served.error().c_str());
    }
  });
  if (!started) return failure(started.error());
  return is_announced.get();
}

Outcome<> serve(const PeerSetting& setting, Serve serve) {
  std::vector<std::string> addresses;
  const std::size_t lane_count = setting.low_caller_count > 0 ? kPeerLaneCount : 1;
  for (std::size_t index = 0; index < lane_count; ++index) {
    auto address = start_lane(setting, serve, index);
    if (!address) return failure(address.error());
    addresses.push_back(std::move(*address));
  }
  report(addresses);
  for (;;)
    pause();
}

// ---- the client ---------------------------------------------------------------------------------

Call caller_of(Exchange exchange) {
  return [exchange = std::move(exchange)](Duration work) -> Outcome<> {
    const PeerMessage request{static_cast<std::uint64_t>(work.count()), {1, -2, 3, -4, 5}};
    PeerMessage reply;
    if (auto done = exchange(request, reply); !done) return done;
    if (reply.work_ns != request.work_ns || reply.values != request.values) {
      return failure("the echo differs");
    }
    return {};
  };
}

Outcome<std::unique_ptr<LowLoad>> connect_load(const PeerSetting& setting) {
  std::vector<Call> callers;
  for (int i = 0; i < setting.low_caller_count; ++i) {
    const std::size_t connecting = kPeer.connects_at_high_priority ? 0 : 1;
    const auto connected = run_as_caller(setting, connecting, [&]() -> Outcome<> {
      auto exchange = kPeer.connect(lane_of(setting, 1, i), setting.addresses.at(1));
      if (!exchange) return failure(exchange.error());
      callers.emplace_back([call = caller_of(std::move(*exchange))](Duration work) {
        return without_exceptions([&] { return call(work); });
      });
      return {};
    });
    if (!connected) return failure(connected.error());
  }
  if (callers.empty()) return std::unique_ptr<LowLoad>();
  return std::make_unique<LowLoad>(setting.placement, setting.realtime, std::move(callers),
                                   Duration{setting.work_ns});
}

std::vector<std::int64_t> all_ns(const Samples& samples) {
  std::vector<std::int64_t> all;
  for (const Duration latency : samples.of_round(0))
    all.push_back(latency.count());
  return all;
}

/// Reports that the client is ready; then runs each plan that rtpm-bench asks for, until that ends.
Outcome<> run_plans(const PeerSetting& setting,
                    const std::function<Outcome<>(const TurnPlan&, Finding&)>& measure) {
  report(std::vector<std::string>{});
  Finding finding{Samples(1, kSampleMax), Samples(1, kSampleMax)};
  while (const auto line = receive_line(setting.link, Duration::max())) {
    finding.first.clear();
    finding.second.clear();
    finding.missing_count = 0;
    const auto plan = line->get<TurnPlan>();
    const auto measured = without_exceptions([&] { return measure(plan, finding); });
    if (!send_line(setting.link,
                   PeerAnswer{measured ? std::string() : measured.error(), all_ns(finding.first),
                              all_ns(finding.second), finding.missing_count})) {
      break;
    }
  }
  return failure("rtpm-bench is gone");
}

Outcome<> call(const PeerSetting& setting) {
  auto exchange = kPeer.connect(lane_of(setting, 0), setting.addresses.at(0));
  if (!exchange) return failure(exchange.error());
  const Call caller = caller_of(std::move(*exchange));
  // One call, so that libraries that connect at their first call have connected.
  if (auto called = caller({}); !called) return called;
  // Only now: the threads that a library has for the whole process are started by its first use,
  // and so have the measured caller's priority.
  const auto load = connect_load(setting);
  if (!load) return failure(load.error());
  return run_plans(setting, [&](const TurnPlan& plan, Finding& finding) {
    return run_turn(plan, caller, load->get(), finding);
  });
}

// ---- events -------------------------------------------------------------------------------------

/// A supplier and its consumers.
class PeerEvents final : public EventSide {
 public:
  [[nodiscard]] Outcome<> connect(const PeerSetting& setting, EventBoard& board) {
    const PeerLane lane = lane_of(setting, 0);
    const std::string& address = setting.addresses.at(0);
    auto push = kPeer.connect_supplier(lane, address.substr(0, address.find(' ')));
    if (!push) return failure(push.error());
    push_ = std::move(*push);
    auto config = thread_config(setting, 0, false);
    config.name = "peer-consumer";
    for (int i = 0; i < setting.consumer_count; ++i) {
      Note& note = notes_.emplace_back(Note{&board, static_cast<std::size_t>(i)});
      auto consume = kPeer.connect_consumer(lane, address.substr(address.rfind(' ') + 1), note);
      if (!consume) return failure(consume.error());
      if (!*consume) continue;
      if (auto started = start_thread(config, std::move(*consume)); !started) return started;
    }
    return {};
  }
  Outcome<> push(const EventStamp& stamp) override { return push_(stamp); }

 private:
  Push push_{};
  std::deque<Note> notes_{};
};

/// Pushes until an event has reached every consumer; they join in their own time.
Outcome<> wait_for_consumers(EventSide& side, EventBoard& board, int consumer_count) {
  const MonotonicTime give_up = rt::now() + std::chrono::seconds{8};
  for (std::uint32_t block = 1; rt::now() < give_up; ++block) {
    board.begin(block);
    const EventStamp stamp{.due_ns = to_ns(rt::now()), .block = block};
    if (auto pushed = side.push(stamp); !pushed) return pushed;
    rt::sleep_until(rt::now() + std::chrono::milliseconds{20});
    if (board.arrived_count() >= static_cast<std::uint64_t>(consumer_count)) return {};
  }
  return failure("no event reached all consumers within 8 s");
}

Outcome<> take_events(const PeerSetting& setting) {
  const int consumer_count = setting.consumer_count;
  // Both live until the process ends: consumers record events until then.
  auto& events = *new EventBoard(static_cast<std::size_t>(consumer_count), kEventBlockSize);
  auto& side = *new PeerEvents;
  if (auto connected = side.connect(setting, events); !connected) return connected;
  if (auto joined = wait_for_consumers(side, events, consumer_count); !joined) return joined;
  // Block numbers above those of the set-up.
  return run_plans(setting,
                   [&, block = 1'000'000U](const TurnPlan& plan, Finding& finding) mutable {
                     return push_events(plan, side, events, block++, consumer_count, finding);
                   });
}

Outcome<> serve_no_events(const PeerLane&, const Announce& announce) {
  announce("none");
  return {};
}

Outcome<> run_role(std::string_view role, const PeerSetting& setting) {
  if (auto locked = rt::lock_memory(setting.realtime); !locked) return failure(locked.error());
  if (role == "broker") {
    return serve(setting, kPeer.serve_events != nullptr ? kPeer.serve_events : serve_no_events);
  }
  if (role == "events") return run_as_caller(setting, 0, [&] { return take_events(setting); });
  if (role == "serve") return serve(setting, kPeer.serve);
  return run_as_caller(setting, 0, [&] { return call(setting); });
}

}  // namespace
}  // namespace rtpm::bench

int main(int argc, char** argv) {
  using namespace rtpm::bench;
  const std::string_view role = argc == 3 ? argv[1] : "";
  const bool is_role = role == "serve" || role == "call" || role == "broker" || role == "events";
  PeerSetting setting;
  try {
    nlohmann::json::parse(is_role ? argv[2] : "").get_to(setting);
  } catch (const nlohmann::json::exception&) {
    std::fprintf(stderr, "rtpm-peer: rtpm-bench starts this program; see rtpm-bench --peers\n");
    return 2;
  }
  report(failure(run_role(role, setting).error()));
  // Not exit(): threads of the library still run.
  _exit(1);
}
