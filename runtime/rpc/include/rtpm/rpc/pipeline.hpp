#pragma once

#include <cstddef>
#include <memory>

namespace rtpm::rpc {

/// Lets calls over UDP share sessions, and go to their server together, as their replies come back:
/// several times as many calls a second as when each goes by itself. Over TCP and shared memory
/// each call has a session of its own, and goes at once.
///
///     rpc::Pipeline pipeline;
///     std::vector<decltype(arm.begin_get_joint(0))> joints;
///     for (std::uint16_t i = 0; i < 7; ++i)
///       joints.push_back(arm.begin_get_joint(i, {.pipeline = &pipeline}));
///     for (auto& joint : joints) show(joint->take());
///
/// A call goes out when as many as share a session have come together (wire::kCallWindow, or fewer
/// where the server grants fewer), when its own reply is asked or waited for, with flush(), or, if
/// further calls are begun or waited for meanwhile, after 200 us. The server may keep a reply back
/// for those of calls that came with it, as long as these are of the same method and take it
/// microseconds. Everything else is as for other calls: at most one run, deadline, priority,
/// cancellation, each for itself.
/// Limits: each session takes a call channel until the pipeline ends, so there are up to
/// NodeConfig::channel_count_max of them per server and band, and over UDP up to wire::kCallWindow
/// calls in each; a reply that is held counts. Beginning the first call of a session waits for the
/// server's handshake.
/// @ownership must outlive its calls and their replies; the nodes of its calls must outlive it
/// @threads  one at a time, together with all of its calls and their replies
/// @realtime to begin and to take a call is alloc-free once there are as many sessions as calls
///           need
class Pipeline {
 public:
  Pipeline();
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;
  ~Pipeline();

  /// Sends the begun calls that wait for others to go with them.
  /// @realtime alloc-free, one syscall for each session that has some
  void flush() noexcept;
  /// The number of calls that have not ended, and of replies that are held.
  /// @realtime alloc-free
  [[nodiscard]] std::size_t open_count() const noexcept;

 private:
  friend class Binding;
  friend class PipelinePlace;
  friend class PipelineSession;
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::rpc
