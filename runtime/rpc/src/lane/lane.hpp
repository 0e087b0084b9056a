#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <vector>

#include "calls/dispatch.hpp"
#include "calls/open_calls.hpp"
#include "execution/execution.hpp"
#include "execution/idling.hpp"
#include "execution/throttling.hpp"
#include "lane/attention.hpp"
#include "local/local.hpp"
#include "media/media.hpp"
#include "model/lane_setup.hpp"
#include "model/report.hpp"
#include "tap/lane_tap.hpp"

namespace rtpm::rpc {

class PooledExecution;

/// One lane: its duty cycle, which polls the sources for calls, and the parts that handle them. The
/// thread that receives a request runs the servant and sends the reply.
/// @threads  adopt(), take_back() and maintain_threads(): the acceptor; stop() and counters(): any;
///           start(), join() and close(): the server, in this order
/// @realtime alloc-free except construction, start() and maintain_threads()
class Lane final : public DutyCycle, public LocalHost {
 public:
  /// @param ports     at least one; if several, each with its index
  /// @param wait_set  the ports are not added to it yet
  Lane(const LaneSetup& setup, std::vector<transport::UdpPort> ports,
       std::unique_ptr<transport::WaitSet> wait_set);

  /// False if the system lacked memory for large messages, streams or queued calls. Then do not
  /// start the lane.
  [[nodiscard]] bool has_memory() const noexcept {
    return media_.has_memory() && calls_.pool()->has_memory();
  }
  /// Starts the lane's threads, once the server has all objects.
  /// @param keeper  see Execution::start(); it must outlive join()
  /// @realtime set-up only
  [[nodiscard]] expected<void, SetupError> start(rt::RealtimeMode realtime, rt::CpuKeeper* keeper);
  void stop() noexcept;
  /// Waits until its threads have ended. Call after stop().
  void join() noexcept { execution_->join(); }
  /// Starts a requested dynamic thread, and joins those that have ended.
  /// @realtime set-up only
  void maintain_threads() noexcept { execution_->maintain_threads(); }
  /// Closes the sockets, so that callers see at once that no lane serves them. Call after join().
  void close() noexcept;

  /// Hands the lane an accepted connection; false if too many are waiting.
  [[nodiscard]] bool adopt(std::unique_ptr<transport::Connection>& stream) noexcept {
    return media_.handover().offer(stream);
  }
  /// An ended connection, to be freed where freeing is allowed; or null.
  [[nodiscard]] std::unique_ptr<transport::Connection> take_back() noexcept {
    return media_.handover().take_back();
  }
  /// Where calls within this program enter.
  [[nodiscard]] const std::shared_ptr<LocalGate>& gate() const noexcept { return gate_; }
  [[nodiscard]] DispatchResult run_nested(const LocalChannel& channel) noexcept override {
    return dispatch_.run_nested(channel, report_);
  }
  /// Call this only in a secured server.
  [[nodiscard]] GatekeeperLink& gatekeeper_link() noexcept { return media_.seals()->link(); }
  /// The threads that a higher lane may borrow; null if the lane has only one.
  [[nodiscard]] PooledExecution* thread_pool() const noexcept { return thread_pool_; }
  [[nodiscard]] const Band& band() const noexcept { return band_; }
  [[nodiscard]] ServerCounters counters() const noexcept { return report_.read(); }
  [[nodiscard]] LaneTap& tap() noexcept { return tap_; }

  void serve(Lead& lead) noexcept override;

 private:
  void step(Lead& lead) noexcept;
  [[nodiscard]] bool turn(Lead& lead) noexcept;
  void serve_seals(Lead& lead, Seals& seals) noexcept;
  [[nodiscard]] bool look(Lead& lead, MonotonicTime until) noexcept;
  [[nodiscard]] bool serve_ready(Lead& lead, SourceTag source) noexcept;
  [[nodiscard]] bool serve_memory(Lead& lead, std::size_t look_count) noexcept;
  [[nodiscard]] bool serve_source(Lead& lead, SourceTag source) noexcept;
  [[nodiscard]] bool serve_gate(Lead& lead) noexcept;
  [[nodiscard]] bool serve_leftover_datagrams(Lead& lead) noexcept;
  [[nodiscard]] bool serve_datagrams(Lead& lead, DatagramPort& port) noexcept;
  [[nodiscard]] bool serve_connection(Lead& lead, Slot& slot) noexcept;
  void obey(Lead& lead, const Pause& pause) noexcept;
  void end(Lead& lead) noexcept;

  const LaneConfig& config_;
  Band band_;
  std::atomic<bool> is_stopping_{false};
  std::unique_ptr<transport::WaitSet> wait_set_;
  std::shared_ptr<Doorbell> doorbell_;
  LaneReport report_;
  LaneTap tap_;
  Media media_;
  OpenCalls calls_;
  std::shared_ptr<LocalGate> gate_;
  LaneRights rights_;
  Dispatch dispatch_;
  Idling idling_;
  Attention attention_;
  std::unique_ptr<Execution> execution_;
  PooledExecution* thread_pool_ = nullptr;  ///< `execution_`, if the lane has several threads.
  MonotonicTime received_{};                ///< When the last frame was received.
  alignas(64) std::array<SourceTag, 64> ready_{};
};

}  // namespace rtpm::rpc
