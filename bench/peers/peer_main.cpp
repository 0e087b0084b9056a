#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <future>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

#include "peer.hpp"
#include "peer_port.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/thread.hpp"
#include "runs/event_run.hpp"
#include "runs/turn.hpp"

// The program of a peer, as rtpm-bench starts it: rtpm-peer-NAME ROLE BOARD. serve and call are the
// two ends of calls, broker and events those of events.
namespace rtpm::bench {
namespace {

using Outcome = expected<void, std::string>;

/// Tells rtpm-bench that all is well, or why not; the first word counts.
void tell(const Outcome& outcome) {
  static std::once_flag once;
  std::call_once(once, [&] {
    const std::string word = outcome ? "+ready" : "-" + outcome.error();
    (void)!write(STDOUT_FILENO, word.data(), word.size());
    close(STDOUT_FILENO);
  });
}

/// Runs what calls a library, whose exceptions end here.
template <class Body>
auto without_exceptions(const Body& body) -> decltype(body()) {
  try {
    return body();
  } catch (const std::exception& error) {
    return unexpected{std::string(error.what())};
  } catch (...) {
    return unexpected{std::string("an exception of the library's own kind")};
  }
}

PeerLane lane_of(const PeerSetting& setting, std::size_t index) {
  return {.index = index,
          .transport = std::string(setting.transport.get()),
          .folder = std::string(setting.folder.get()),
          .connection_count = index == 0 ? 1 : setting.low_caller_count,
          .priority = index == 0 ? kHighPriority : kLowPriority};
}

rt::ThreadConfig thread_config(const PeerSetting& setting, std::size_t index, bool is_server) {
  return {.name = index == 0 ? "peer-high" : "peer-low",
          .priority = index == 0 ? kHighPriority : kLowPriority,
          .cpus = {is_server ? setting.placement.server_cpu : setting.placement.client_cpu},
          .realtime = setting.realtime};
}

/// Runs `body` on a thread of a lane's kind, to its end.
Outcome run_on_lane_thread(const PeerSetting& setting, std::size_t index, bool is_server,
                           const std::function<Outcome()>& body) {
  Outcome outcome;
  auto thread = rt::Thread::start(thread_config(setting, index, is_server),
                                  [&] { outcome = without_exceptions(body); });
  if (!thread) return unexpected{thread.error().text()};
  thread->join();
  return outcome;
}

// ---- the server ---------------------------------------------------------------------------------

using Serve = Outcome (Peer::*)(const PeerLane&, const Announce&);

/// Starts a lane's thread and waits until the lane can be called.
Outcome start_lane(PeerBoard& board, Peer& peer, Serve serve, std::size_t index) {
  auto announced = std::make_shared<std::promise<Outcome>>();
  auto is_announced = announced->get_future();
  auto thread = rt::Thread::start(
      thread_config(board.setting, index, true), [announced, index, serve, &board, &peer] {
        const Announce publish_link_report = [&](const std::string& address) {
          board.setting.addresses[index].set(address);
          announced->set_value({});
        };
        const auto served = without_exceptions(
            [&] { return (peer.*serve)(lane_of(board.setting, index), publish_link_report); });
        if (served) return;
        // If it was announced before, its callers' deadlines tell that it serves no longer.
        try {
          announced->set_value(served);
        } catch (const std::future_error&) {
          std::fprintf(stderr, "peer: a lane ended: %s\n", served.error().c_str());
        }
      });
  if (!thread) return unexpected{thread.error().text()};
  // It serves until the process ends.
  static_cast<void>(new rt::Thread(std::move(*thread)));
  return is_announced.get();
}

Outcome serve(PeerBoard& board, Peer& peer, Serve serve) {
  const std::size_t lane_count = board.setting.low_caller_count > 0 ? 2 : 1;
  for (std::size_t index = 0; index < lane_count; ++index) {
    if (auto started = start_lane(board, peer, serve, index); !started) return started;
  }
  tell({});
  for (;;)
    pause();
}

// ---- the client ---------------------------------------------------------------------------------

expected<std::unique_ptr<LowLoad>, std::string> connect_load(PeerBoard& board, Peer& peer) {
  const PeerSetting& setting = board.setting;
  std::vector<Job> jobs;
  for (int i = 0; i < setting.low_caller_count; ++i) {
    const auto connected = run_on_lane_thread(
        setting, peer.connects_at_high_priority() ? 0 : 1, false, [&]() -> Outcome {
          auto caller = peer.connect(lane_of(setting, 1), std::string(setting.addresses[1].get()));
          if (!caller) return unexpected{caller.error()};
          // Shared, because a job is copied.
          jobs.emplace_back([held = std::shared_ptr<Caller>(std::move(*caller)),
                             work = Duration{setting.work_ns}] {
            return without_exceptions([&] { return held->work(work); });
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

Outcome call(PeerBoard& board, Peer& peer) {
  return run_on_lane_thread(board.setting, 0, false, [&]() -> Outcome {
    auto caller =
        peer.connect(lane_of(board.setting, 0), std::string(board.setting.addresses[0].get()));
    if (!caller) return unexpected{caller.error()};
    // One call, so that what connects at the first one has connected.
    if (auto called = (*caller)->echo(); !called) return called;
    // Only now: threads that a library has for the whole process are started by the first use of
    // it, and so have the measured caller's priority.
    auto load = connect_load(board, peer);
    if (!load) return unexpected{load.error()};
    tell({});
    Samples high(1, kPeerSampleMax);
    Samples low(1, kPeerSampleMax);
    for (;;) {
      board.wait_for_plan();
      high.clear();
      low.clear();
      const auto taken = without_exceptions(
          [&] { return run_turn(board.plan, **caller, load->get(), high, low); });
      board.error.set(taken ? std::string() : taken.error());
      put(high, board.high_ns, board.high_count);
      put(low, board.low_ns, board.low_count);
      sem_post(&board.answered);
    }
  });
}

// ---- events -------------------------------------------------------------------------------------

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

Outcome take_events(PeerBoard& board, Peer& peer) {
  const int consumer_count = board.setting.consumer_count;
  return run_on_lane_thread(board.setting, 0, false, [&]() -> Outcome {
    EventBoard events(static_cast<std::size_t>(consumer_count), kEventBlockSize);
    auto side =
        peer.connect_events(lane_of(board.setting, 0),
                            std::string(board.setting.addresses[0].get()), consumer_count, events);
    if (!side) return unexpected{side.error()};
    if (auto joined = wait_for_consumers(**side, events, consumer_count); !joined) return joined;
    tell({});
    // Above those of the set-up.
    for (std::uint32_t block = 1'000'000;; ++block) {
      board.wait_for_plan();
      EventFinding finding(1, kEventBlockSize, consumer_count);
      const auto measured = without_exceptions([&] {
        return measure_events(Duration{board.plan.period_ns},
                              static_cast<std::size_t>(board.plan.count), **side, events, block,
                              consumer_count, finding);
      });
      board.error.set(measured ? std::string() : measured.error());
      put(finding.each, board.high_ns, board.high_count);
      put(finding.last, board.low_ns, board.low_count);
      board.missing_count = finding.missing_count;
      sem_post(&board.answered);
    }
  });
}

// Of the child that stays while its parent becomes a broker: says that the broker serves.
[[noreturn]] void tell_of(const BrokerProgram& broker) {
  const bool is_there =
      broker.path.empty() ? wait_for_port(broker.port) : wait_for_socket(broker.path);
  tell(is_there ? Outcome() : unexpected{std::string("the broker does not serve after 10 s")});
  _exit(0);
}

// Replaces this program, which has no other thread yet.
Outcome become(PeerBoard& board, BrokerProgram broker) {
  board.setting.addresses[0].set(broker.address);
  const pid_t child = fork();
  if (child < 0) return unexpected{std::string("no process for a broker")};
  if (child == 0) tell_of(broker);
  if (auto set = rt::configure_this_thread(thread_config(board.setting, 0, true)); !set) {
    return unexpected{set.error().text()};
  }
  const int nowhere = open("/dev/null", O_WRONLY);
  dup2(nowhere, STDOUT_FILENO);
  dup2(nowhere, STDERR_FILENO);
  std::vector<char*> arguments;
  for (std::string& argument : broker.command)
    arguments.push_back(argument.data());
  arguments.push_back(nullptr);
  execv(arguments[0], arguments.data());
  _exit(1);
}

Outcome serve_events(PeerBoard& board, Peer& peer) {
  auto broker = peer.broker_program(lane_of(board.setting, 0));
  if (broker) return become(board, std::move(*broker));
  return serve(board, peer, &Peer::serve_events);
}

}  // namespace

expected<rt::Thread, std::string> start_consumer(std::function<void()> body) {
  // Of its starter it inherits only the CPU.
  const bool is_realtime = sched_getscheduler(0) == SCHED_FIFO;
  auto thread = rt::Thread::start(
      {.name = "peer-consumer",
       .priority = kHighPriority,
       .realtime = is_realtime ? rt::RealtimeMode::kPrefer : rt::RealtimeMode::kOff},
      std::move(body));
  if (!thread) return unexpected{thread.error().text()};
  return std::move(*thread);
}

int run_peer(std::string_view role, int board_file) {
  auto board = SharedBoard::open(board_file);
  if (!board) {
    std::fprintf(stderr, "rtpm-peer: %s\n", board.error().c_str());
    return 2;
  }
  PeerBoard& shared = *board->operator->();
  if (auto locked = rt::lock_memory(shared.setting.realtime); !locked) {
    tell(unexpected{locked.error().text()});
    return 1;
  }
  const auto peer = make_peer();
  Outcome outcome;
  if (role == "serve") outcome = serve(shared, *peer, &Peer::serve);
  if (role == "broker") outcome = serve_events(shared, *peer);
  if (role == "call") outcome = call(shared, *peer);
  if (role == "events") outcome = take_events(shared, *peer);
  tell(outcome);
  return 1;
}

}  // namespace rtpm::bench

int main(int argc, char** argv) {
  const std::string_view role = argc == 3 ? argv[1] : "";
  if (role != "serve" && role != "call" && role != "broker" && role != "events") {
    std::fprintf(stderr, "rtpm-peer: rtpm-bench starts this program; see rtpm-bench --peers\n");
    return 2;
  }
  return rtpm::bench::run_peer(role, std::atoi(argv[2]));
}
