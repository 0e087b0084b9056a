#include <unistd.h>

#include <cstdio>
#include <exception>
#include <future>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

#include "peer.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/thread.hpp"
#include "turn.hpp"

// The program of a peer, as rtpm-bench starts it: rtpm-peer-NAME serve|call BOARD.
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
  if (!thread) return unexpected{thread.error().text};
  thread->join();
  return outcome;
}

// ---- the server ---------------------------------------------------------------------------------

/// Starts a lane's thread and waits until the lane can be called.
Outcome start_lane(PeerBoard& board, Peer& peer, std::size_t index) {
  auto announced = std::make_shared<std::promise<Outcome>>();
  auto is_announced = announced->get_future();
  auto thread = rt::Thread::start(
      thread_config(board.setting, index, true), [announced, index, &board, &peer] {
        const Announce announce = [&](const std::string& address) {
          board.setting.addresses[index].set(address);
          announced->set_value({});
        };
        const auto served =
            without_exceptions([&] { return peer.serve(lane_of(board.setting, index), announce); });
        if (served) return;
        // If it was announced before, its callers' deadlines tell that it serves no longer.
        try {
          announced->set_value(served);
        } catch (const std::future_error&) {
          std::fprintf(stderr, "peer: a lane ended: %s\n", served.error().c_str());
        }
      });
  if (!thread) return unexpected{thread.error().text};
  // It serves until the process ends.
  static_cast<void>(new rt::Thread(std::move(*thread)));
  return is_announced.get();
}

Outcome serve(PeerBoard& board, Peer& peer) {
  const std::size_t lane_count = board.setting.low_caller_count > 0 ? 2 : 1;
  for (std::size_t index = 0; index < lane_count; ++index) {
    if (auto started = start_lane(board, peer, index); !started) return started;
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

}  // namespace

int run_peer(std::string_view role, int board_file) {
  auto board = SharedBoard::open(board_file);
  if (!board) {
    std::fprintf(stderr, "rtpm-peer: %s\n", board.error().c_str());
    return 2;
  }
  PeerBoard& shared = *board->operator->();
  if (auto locked = rt::lock_memory(shared.setting.realtime); !locked) {
    tell(unexpected{locked.error().text});
    return 1;
  }
  const auto peer = make_peer();
  const auto outcome = role == "serve" ? serve(shared, *peer) : call(shared, *peer);
  tell(outcome);
  return 1;
}

}  // namespace rtpm::bench

int main(int argc, char** argv) {
  const std::string_view role = argc == 3 ? argv[1] : "";
  if (role != "serve" && role != "call") {
    std::fprintf(stderr, "rtpm-peer: rtpm-bench starts this program; see rtpm-bench --peers\n");
    return 2;
  }
  return rtpm::bench::run_peer(role, std::atoi(argv[2]));
}
