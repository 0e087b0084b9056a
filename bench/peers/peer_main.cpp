#include <sched.h>
#include <signal.h>
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
#include "runs/turn.hpp"

// The program of a peer, as rtpm-bench starts it: rtpm-peer-NAME ROLE BOARD. serve and call are the
// two ends of calls, broker and events those of events.
namespace rtpm::bench {
namespace {

/// Reports to rtpm-bench that all is well, or why not; only the first report counts.
void report(const Outcome& outcome) {
  static std::once_flag once;
  std::call_once(once, [&] {
    const std::string word = outcome ? "+ready" : "-" + outcome.error();
    (void)!write(STDOUT_FILENO, word.data(), word.size());
    close(STDOUT_FILENO);
  });
}

/// Runs code that calls a library, and catches its exceptions.
Outcome without_exceptions(const std::function<Outcome()>& body) {
  try {
    return kPeer.guard == nullptr ? body() : kPeer.guard(body);
  } catch (const std::exception& error) {
    return unexpected{std::string(error.what())};
  } catch (...) {
    return unexpected{std::string("an exception of the library's own kind")};
  }
}

PeerLane lane_of(const PeerSetting& setting, std::size_t index, int caller = 0) {
  return {.index = index,
          .transport = std::string(setting.transport.get()),
          .folder = std::string(setting.folder.get()),
          .connection_count = index == 0 ? 1 : setting.low_caller_count,
          .caller = caller,
          .priority = index == 0 ? kHighPriority : kLowPriority};
}

std::string address_of(const PeerSetting& setting, std::size_t index) {
  return std::string(setting.addresses[index].get());
}

rt::ThreadConfig thread_config(const PeerSetting& setting, std::size_t index, bool is_server) {
  return {.name = index == 0 ? "peer-high" : "peer-low",
          .priority = index == 0 ? kHighPriority : kLowPriority,
          .cpus = {is_server ? setting.placement.server_cpu : setting.placement.client_cpu},
          .realtime = setting.realtime};
}

/// Starts a thread that lives until the process ends.
Outcome start_thread(const rt::ThreadConfig& config, std::function<void()> body) {
  auto thread = rt::Thread::start(config, std::move(body));
  if (!thread) return unexpected{thread.error().text()};
  static_cast<void>(new rt::Thread(std::move(*thread)));
  return {};
}

/// Runs `body` to its end on a thread with the policy, priority and CPU of a lane's callers.
Outcome run_as_caller(const PeerSetting& setting, std::size_t index,
                      const std::function<Outcome()>& body) {
  Outcome outcome;
  auto thread = rt::Thread::start(thread_config(setting, index, false),
                                  [&] { outcome = without_exceptions(body); });
  if (!thread) return unexpected{thread.error().text()};
  thread->join();
  return outcome;
}

// ---- the server ---------------------------------------------------------------------------------

using Serve = Outcome (*)(const PeerLane&, const Announce&);

/// Starts a lane's thread and waits until the lane can be called.
Outcome start_lane(PeerBoard& board, Serve serve, std::size_t index) {
  auto announced = std::make_shared<std::promise<Outcome>>();
  auto is_announced = announced->get_future();
  const auto started =
      start_thread(thread_config(board.setting, index, true), [announced, index, serve, &board] {
        const Announce announce = [&](const std::string& address) {
          board.setting.addresses[index].set(address);
          announced->set_value({});
        };
        const auto served =
            without_exceptions([&] { return serve(lane_of(board.setting, index), announce); });
        if (served) return;
        // If it was announced before, its callers' deadlines show that it no longer serves.
        try {
          announced->set_value(served);
        } catch (const std::future_error&) {
          std::fprintf(stderr, "peer: a lane ended: %s\n", served.error().c_str());
        }
      });
  return started ? is_announced.get() : started;
}

Outcome serve(PeerBoard& board, Serve serve) {
  const std::size_t lane_count = board.setting.low_caller_count > 0 ? 2 : 1;
  for (std::size_t index = 0; index < lane_count; ++index) {
    if (auto started = start_lane(board, serve, index); !started) return started;
  }
  report({});
  for (;;)
    pause();
}

// ---- the client ---------------------------------------------------------------------------------

class PeerCaller final : public Caller {
 public:
  explicit PeerCaller(Exchange exchange) : exchange_(std::move(exchange)) {}
  Outcome echo() override { return work(Duration{0}); }
  Outcome work(Duration duration) override {
    const PeerMessage request{static_cast<std::uint64_t>(duration.count()), {1, -2, 3, -4, 5}};
    PeerMessage reply;
    if (auto done = exchange_(request, reply); !done) return done;
    if (reply.work_ns != request.work_ns || reply.values != request.values) {
      return unexpected{std::string("the echo differs")};
    }
    return {};
  }

 private:
  Exchange exchange_;
};

expected<std::unique_ptr<LowLoad>, std::string> connect_load(const PeerSetting& setting) {
  std::vector<Job> jobs;
  for (int i = 0; i < setting.low_caller_count; ++i) {
    const std::size_t connecting = kPeer.connects_at_high_priority ? 0 : 1;
    const auto connected = run_as_caller(setting, connecting, [&]() -> Outcome {
      auto exchange = kPeer.connect(lane_of(setting, 1, i), address_of(setting, 1));
      if (!exchange) return unexpected{exchange.error()};
      // Shared, because a job is copied.
      jobs.emplace_back([caller = std::make_shared<PeerCaller>(std::move(*exchange)),
                         work = Duration{setting.work_ns}] {
        return without_exceptions([&] { return caller->work(work); });
      });
      return {};
    });
    if (!connected) return unexpected{connected.error()};
  }
  if (jobs.empty()) return std::unique_ptr<LowLoad>();
  return std::make_unique<LowLoad>(setting.placement, setting.realtime, std::move(jobs));
}

void put(const Samples& samples, std::array<std::int64_t, kPeerSampleMax>& to,
         std::uint64_t& count) {
  const auto latencies = samples.of_round(0).first(std::min(samples.count(), kPeerSampleMax));
  for (std::size_t i = 0; i < latencies.size(); ++i)
    to[i] = latencies[i].count();
  count = latencies.size();
}

/// Reports that the client is ready; then runs each plan that rtpm-bench asks for, without end.
/// `measure` fills the samples of high and low priority, or of each delivery and the last ones.
[[noreturn]] void run_plans(PeerBoard& board,
                            const std::function<Outcome(Samples& high, Samples& low)>& measure) {
  report({});
  Samples high(1, kPeerSampleMax);
  Samples low(1, kPeerSampleMax);
  for (;;) {
    board.wait_for_plan();
    high.clear();
    low.clear();
    const auto measured = without_exceptions([&] { return measure(high, low); });
    board.error.set(measured ? std::string() : measured.error());
    put(high, board.high_ns, board.high_count);
    put(low, board.low_ns, board.low_count);
    sem_post(&board.answered);
  }
}

Outcome call(PeerBoard& board) {
  auto exchange = kPeer.connect(lane_of(board.setting, 0), address_of(board.setting, 0));
  if (!exchange) return unexpected{exchange.error()};
  PeerCaller caller(std::move(*exchange));
  // One call, so that libraries that connect at their first call have connected.
  if (auto called = caller.echo(); !called) return called;
  // Only now: the threads that a library has for the whole process are started by its first use,
  // and so have the measured caller's priority.
  const auto load = connect_load(board.setting);
  if (!load) return unexpected{load.error()};
  run_plans(board, [&](Samples& high, Samples& low) {
    return run_turn(board.plan, caller, load->get(), high, low);
  });
}

// ---- events -------------------------------------------------------------------------------------

/// A supplier and its consumers.
class PeerEvents final : public EventSide {
 public:
  [[nodiscard]] Outcome connect(const PeerSetting& setting, EventBoard& board) {
    const PeerLane lane = lane_of(setting, 0);
    const std::string address = address_of(setting, 0);
    auto push = kPeer.connect_supplier(lane, address.substr(0, address.find(' ')));
    if (!push) return unexpected{push.error()};
    push_ = std::move(*push);
    auto config = thread_config(setting, 0, false);
    config.name = "peer-consumer";
    for (int i = 0; i < setting.consumer_count; ++i) {
      Note& note = notes_.emplace_back(Note{&board, static_cast<std::size_t>(i)});
      auto consume = kPeer.connect_consumer(lane, address.substr(address.rfind(' ') + 1), note);
      if (!consume) return unexpected{consume.error()};
      if (!*consume) continue;
      if (auto started = start_thread(config, std::move(*consume)); !started) return started;
    }
    return {};
  }
  Outcome push(const EventStamp& stamp) override { return push_(stamp); }

 private:
  Push push_{};
  std::deque<Note> notes_{};
};

/// Pushes until an event has reached every consumer; they join in their own time.
Outcome wait_for_consumers(EventSide& side, EventBoard& board, int consumer_count) {
  const MonotonicTime give_up = rt::now() + std::chrono::seconds{8};
  for (std::uint32_t block = 1; rt::now() < give_up; ++block) {
    board.begin(block);
    const EventStamp stamp{.due_ns = to_ns(rt::now()), .block = block};
    if (auto pushed = side.push(stamp); !pushed) return pushed;
    rt::sleep_until(rt::now() + std::chrono::milliseconds{20});
    if (board.arrived_count() >= static_cast<std::uint64_t>(consumer_count)) return {};
  }
  return unexpected{std::string("no event reached all consumers within 8 s")};
}

Outcome take_events(PeerBoard& board) {
  const int consumer_count = board.setting.consumer_count;
  // Both live until the process ends: consumers record events until then.
  auto& events = *new EventBoard(static_cast<std::size_t>(consumer_count), kEventBlockSize);
  auto& side = *new PeerEvents;
  if (auto connected = side.connect(board.setting, events); !connected) return connected;
  if (auto joined = wait_for_consumers(side, events, consumer_count); !joined) return joined;
  // Block numbers above those of the set-up.
  run_plans(board, [&, block = 1'000'000U](Samples& high, Samples& low) mutable {
    board.missing_count = 0;
    return push_events(board.plan, side, events, block++, consumer_count, high, low,
                       board.missing_count);
  });
}

Outcome serve_no_events(const PeerLane&, const Announce& announce) {
  announce("none");
  return {};
}

Outcome run_role(std::string_view role, PeerBoard& board) {
  if (auto locked = rt::lock_memory(board.setting.realtime); !locked) {
    return unexpected{locked.error().text()};
  }
  if (role == "broker") {
    return serve(board, kPeer.serve_events != nullptr ? kPeer.serve_events : serve_no_events);
  }
  if (role == "events") return run_as_caller(board.setting, 0, [&] { return take_events(board); });
  if (role == "serve") return serve(board, kPeer.serve);
  return run_as_caller(board.setting, 0, [&] { return call(board); });
}

}  // namespace
}  // namespace rtpm::bench

int main(int argc, char** argv) {
  using namespace rtpm::bench;
  const std::string_view role = argc == 3 ? argv[1] : "";
  if (role != "serve" && role != "call" && role != "broker" && role != "events") {
    std::fprintf(stderr, "rtpm-peer: rtpm-bench starts this program; see rtpm-bench --peers\n");
    return 2;
  }
  auto board = SharedBoard::open(std::atoi(argv[2]));
  if (!board) {
    std::fprintf(stderr, "rtpm-peer: %s\n", board.error().c_str());
    return 2;
  }
  report(run_role(role, *board->operator->()));
  // Not exit(): threads of the library still run.
  _exit(1);
}
