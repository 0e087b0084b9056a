#pragma once

#include <atomic>

#include "calls/deferral.hpp"
#include "calls/dispatch.hpp"
#include "calls/open_calls.hpp"
#include "execution/idling.hpp"
#include "model/lane_setup.hpp"
#include "model/report.hpp"
#include "rtpm/rt/cpu_keeper.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rpc {

/// A lane's duty cycle.
class DutyCycle {
 public:
  /// Serves until the lane stops, or until another thread becomes the leader.
  /// @threads  the lane's, one at a time
  virtual void serve(Lead& lead) noexcept = 0;

 protected:
  ~DutyCycle() = default;
};

/// The parts of a lane that its execution uses.
struct LaneParts {
  DutyCycle& cycle;
  const LaneConfig& config;
  const std::atomic<bool>& is_stopping;
  LaneSlot& slot;
  const Dispatch& dispatch;
  OpenCalls& calls;
  LaneReport& report;
  Idling& idling;
  transport::WaitSet& wait_set;
};

/// The threads of a lane; decides which of them runs a call.
/// @threads  functions with a Lead: the leader; start() to maintain_threads(): one at a time,
///           without a Lead
/// @realtime alloc-free except construction, start() and maintain_threads()
class Execution {
 public:
  explicit Execution(const LaneParts& parts) noexcept : parts_(parts) {}
  Execution(const Execution&) = delete;
  Execution& operator=(const Execution&) = delete;
  virtual ~Execution() = default;

  /// Starts the threads.
  /// @realtime set-up only
  /// @param keeper  keeps the CPU awake during their pauses; null if it may sleep
  /// @errors  those of rt::Thread::start()
  [[nodiscard]] expected<void, SetupError> start(rt::RealtimeMode realtime, rt::CpuKeeper* keeper);
  /// Waits until the threads have ended. Call after the lane's stop.
  virtual void join() noexcept = 0;
  /// Starts a requested dynamic thread, and joins those that have ended.
  /// @realtime set-up only
  virtual void maintain_threads() noexcept {}

  /// Runs, queues or refuses a call that arrived over a transport.
  /// @return the frame to answer with; empty if there is no answer, or a later one
  [[nodiscard]] virtual ConstBytes accept(Lead&, wire::ServerSessions& sessions,
                                          const wire::Request& request) noexcept = 0;
  /// Runs, queues or refuses a call within this program, and answers it.
  virtual void accept(Lead&, LocalChannel& channel) noexcept = 0;
  /// Whether accept() only queues calls, so that it should get all waiting ones.
  [[nodiscard]] virtual bool only_orders() const noexcept { return false; }

  /// The lock that the leader holds except while it sleeps; null if there is none.
  [[nodiscard]] virtual transport::WaitLock* lock() noexcept { return nullptr; }
  /// Whether the leader should hand the lead to another thread; queried between turns.
  [[nodiscard]] virtual bool yields_lead(Lead&) noexcept { return false; }
  /// Sleeps without the lead until `until`, ignoring events.
  virtual void sleep(Lead&, MonotonicTime until) noexcept;
  /// Keeps the CPU awake while this lane pauses, so that calls of other lanes are as fast as usual.
  void keep_cpu_awake(MonotonicTime until) const noexcept;

  /// Refuses the calls that wait for a thread, when the lane stops.
  virtual void refuse_waiting(Lead&) noexcept {}
  /// Whether any method is still running.
  [[nodiscard]] virtual bool is_running(Lead&) const noexcept { return false; }
  /// Makes all threads end.
  virtual void end(Lead&) noexcept {}

 protected:
  [[nodiscard]] virtual expected<void, SetupError> start_threads() = 0;
  [[nodiscard]] rt::ThreadConfig thread_config(std::uint32_t index) const;

  /// Runs a call over a transport on the calling thread.
  [[nodiscard]] ConstBytes run_now(Lead&, wire::ServerSessions& sessions,
                                   const wire::Request& request) noexcept;
  [[nodiscard]] DispatchResult run_method(Lead&, const Target& target, const wire::Request& request,
                                          MutableBytes reply, CallDeferral& deferral) noexcept;

  const LaneParts parts_;

 private:
  [[nodiscard]] ConstBytes run_without_buffer(Lead&, wire::ServerSessions& sessions,
                                              const wire::Request& request) noexcept;
  [[nodiscard]] ConstBytes run_confirmed(Lead&, wire::ServerSessions& sessions,
                                         const wire::Request& request) noexcept;
  [[nodiscard]] ConstBytes complete(Lead&, wire::ServerSessions& sessions,
                                    const wire::Request& request, const CallDeferral& deferral,
                                    DispatchResult result) noexcept;
  [[nodiscard]] DispatchResult serve(Lead&, wire::ServerSessions& sessions,
                                     const wire::Request& request, MutableBytes reply,
                                     CallDeferral& deferral) noexcept;

  rt::RealtimeMode realtime_ = rt::RealtimeMode::kPrefer;
  rt::CpuKeeper* keeper_ = nullptr;
};

/// One thread that receives and runs all calls, one at a time.
class SoloExecution final : public Execution {
 public:
  using Execution::Execution;

  void join() noexcept override { thread_.join(); }
  [[nodiscard]] ConstBytes accept(Lead& lead, wire::ServerSessions& sessions,
                                  const wire::Request& request) noexcept override {
    return run_now(lead, sessions, request);
  }
  void accept(Lead&, LocalChannel& channel) noexcept override;

 private:
  [[nodiscard]] expected<void, SetupError> start_threads() override;

  rt::Thread thread_;
};

}  // namespace rtpm::rpc
