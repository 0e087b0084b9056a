#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "local/ready_list.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/wait.hpp"
#include "rtpm/wire/status.hpp"

// Calls to objects of the same program, without frames or sockets: the lane that would serve a
// remote call runs it, on memory that both sides share.
namespace rtpm::rpc {

class LocalChannel;
class LocalOneways;

/// The lane that a gate leads to.
class LocalHost {
 public:
  /// Runs a method inside another method of this lane, on the same thread.
  /// @threads  the lane's thread that runs the outer method
  [[nodiscard]] virtual DispatchResult run_nested(const LocalChannel& channel) noexcept = 0;

 protected:
  ~LocalHost() = default;
};

/// The parameters of a local call, except its request.
struct LocalCallParameters {
  std::uint32_t service = 0;
  std::uint16_t method = 0;
  Priority priority{};
  std::uint64_t session = 0;  ///< The binding's number, not a wire session.
  std::uint64_t trace_id = 0;
  MonotonicTime deadline{};
  std::uint32_t message_size_max = 0;  ///< The smaller limit of the node and the server.
};

/// The memory of one local call at a time. Ownership passes from the caller to the lane and back.
/// If the caller gives up, the lane owns it until the call is done. The lane owns a oneway's memory
/// from the start.
/// @threads  try_take(): any; the lane's functions: the lane; the rest: the thread that took it
/// @realtime alloc-free except construction; at most one syscall per side, to wake or to wait
class LocalChannel {
 public:
  explicit LocalChannel(std::uint32_t message_size_max);
  /// A slot of `home`, which owns the memory; `number` is the slot's index there.
  LocalChannel(MutableBytes request_room, MutableBytes reply_room, LocalOneways& home,
               std::uint32_t number) noexcept
      : request_room_(request_room), reply_room_(reply_room), home_(&home), number_(number) {}

  [[nodiscard]] bool try_take() noexcept {
    State free = State::kFree;
    return state_.compare_exchange_strong(free, State::kTaken, std::memory_order_acquire);
  }
  void release() noexcept { state_.store(State::kFree, std::memory_order_release); }
  [[nodiscard]] std::uint32_t number() const noexcept { return number_; }
  /// Whether no caller or lane uses it.
  [[nodiscard]] bool is_free() const noexcept {
    return state_.load(std::memory_order_acquire) == State::kFree;
  }

  /// Releases a channel or slot that was not submitted.
  void give_up() noexcept;

  /// Copies the request; false if it is too large.
  [[nodiscard]] bool write(const LocalCallParameters& parameters, ConstBytes request) noexcept;
  /// Hands the channel to the lane. `is_awaited`: the caller waits.
  void submit(bool is_awaited) noexcept {
    state_.store(is_awaited ? State::kSubmitted : State::kLeft, std::memory_order_release);
  }
  /// Waits until the lane is done. False after the deadline: then the lane owns the channel.
  [[nodiscard]] bool wait(const rt::WaitConfig& how) noexcept;
  [[nodiscard]] wire::Status status() const noexcept { return status_; }
  [[nodiscard]] ConstBytes result() const noexcept { return reply_room_.first(size_); }

  // The functions below are called by the lane.
  [[nodiscard]] const LocalCallParameters& parameters() const noexcept { return parameters_; }
  [[nodiscard]] ConstBytes request() const noexcept { return request_room_.first(request_size_); }
  [[nodiscard]] MutableBytes reply() const noexcept {
    return reply_room_.first(parameters_.message_size_max);
  }
  /// Whether it is a slot for oneways, whose reply() nobody reads.
  [[nodiscard]] bool is_place() const noexcept { return home_ != nullptr; }
  /// Returns the channel to the caller, or frees it.
  void finish(wire::Status status, std::uint32_t size) noexcept;

  std::atomic<LocalChannel*> next_ready{nullptr};

 private:
  enum class State : std::uint8_t {
    kFree,
    kTaken,
    kSubmitted,  ///< The lane owns it; the caller polls.
    kWaiting,    ///< The lane owns it; the caller sleeps.
    kLeft,       ///< The lane owns it; the caller no longer waits.
    kDone,
  };

  LocalCallParameters parameters_{};
  rt::LazyMemory request_;  ///< The channel's own memory, unless it is a slot.
  rt::LazyMemory reply_;
  MutableBytes request_room_;
  MutableBytes reply_room_;
  LocalOneways* home_ = nullptr;
  std::uint32_t number_ = 0;
  std::size_t request_size_ = 0;
  alignas(64) std::atomic<State> state_{State::kFree};
  wire::Status status_ = wire::Status::kOk;
  std::uint32_t size_ = 0;
  rt::Semaphore done_;
};

/// Where local calls enter a lane. May outlive the lane.
/// @threads  submit(), take_place(), open_places() and is_closed(): any; the rest: the lane
/// @realtime alloc-free except open_places()
class LocalGate {
 public:
  /// `oneway_count_max`: how many oneways may wait or run.
  LocalGate(std::shared_ptr<Doorbell> bell, LocalHost& host, std::uint32_t oneway_count_max,
            std::uint32_t message_size_max) noexcept;
  LocalGate(const LocalGate&) = delete;
  LocalGate& operator=(const LocalGate&) = delete;
  ~LocalGate();

  void submit(LocalChannel& call, bool is_awaited) noexcept;
  /// Creates the slots for oneways, unless they exist.
  /// @realtime set-up only
  void open_places();
  /// Whether a oneway of that size uses the slots.
  [[nodiscard]] bool has_places_for(std::size_t size) const noexcept;
  /// Takes a free slot. Null if all are in use, which the lane counts as overload. The first call
  /// allocates, unless open_places() was called.
  [[nodiscard]] LocalChannel* take_place() noexcept;

  [[nodiscard]] bool has_calls() const noexcept {
    return !calls_.is_empty() || refused_count_.load(std::memory_order_relaxed) > 0;
  }
  [[nodiscard]] bool may_sleep() const noexcept {
    return calls_.is_empty_before_sleep() && refused_count_.load(std::memory_order_seq_cst) == 0;
  }
  /// The call that arrived first, or null.
  [[nodiscard]] LocalChannel* take_next() noexcept { return calls_.take_next(); }
  /// How many oneways found no slot since the last query.
  [[nodiscard]] std::uint32_t take_refused_count() noexcept;
  /// Makes calls end with kStopping from now on.
  void close() noexcept;
  [[nodiscard]] bool is_closed() const noexcept {
    return is_closed_.load(std::memory_order_relaxed);
  }
  /// Use it only for comparison, or on the lane's own thread.
  [[nodiscard]] LocalHost& host() const noexcept { return host_; }

 private:
  ReadyList<LocalChannel> calls_;
  std::atomic<std::uint32_t> refused_count_{0};
  std::atomic<bool> is_closed_{false};
  std::shared_ptr<Doorbell> bell_;
  LocalHost& host_;
  std::uint32_t oneway_count_max_;
  std::uint32_t message_size_max_;
  rt::PiMutex opening_;
  std::unique_ptr<LocalOneways> places_;
  std::atomic<LocalOneways*> open_places_{nullptr};  ///< `places_`, once complete.
};

/// A server as callers in the same program see it; found by its epoch while the server runs.
/// @threads  any
/// @realtime gate_of() is alloc-free; the rest is set-up only
class LocalDoor {
 public:
  struct Entry {
    Band band{};
    std::shared_ptr<LocalGate> gate;
  };

  LocalDoor(std::uint64_t epoch, Priority ceiling, std::uint32_t message_size_max,
            std::vector<Entry> entries)
      : epoch_(epoch),
        ceiling_(ceiling),
        message_size_max_(message_size_max),
        entries_(std::move(entries)) {}

  /// The lane that serves the priority; null above the ceiling.
  [[nodiscard]] LocalGate* gate_of(Priority priority) const noexcept;
  [[nodiscard]] std::uint32_t message_size_max() const noexcept { return message_size_max_; }
  /// Creates the oneway slots of these priorities' lanes; of all lanes if the list is empty.
  void open_places(std::span<const Priority> priorities) const;

  static void open(const std::shared_ptr<LocalDoor>& door);
  static void close(const LocalDoor& door) noexcept;
  /// The running server with that epoch in this program, or null.
  [[nodiscard]] static std::shared_ptr<LocalDoor> find(std::uint64_t epoch);

 private:
  std::uint64_t epoch_;
  Priority ceiling_;
  std::uint32_t message_size_max_;
  std::vector<Entry> entries_;
};

/// The local channels of a node.
/// @threads  any
/// @realtime take() is alloc-free once there are as many as are used at a time
class LocalChannels {
 public:
  /// A new session number for a binding's parameters.
  [[nodiscard]] static std::uint64_t next_session() noexcept;

  LocalChannels(std::uint32_t count_max, std::uint32_t message_size_max);
  LocalChannels(const LocalChannels&) = delete;
  LocalChannels& operator=(const LocalChannels&) = delete;
  /// Channels still owned by a lane are kept until it is done.
  ~LocalChannels();

  [[nodiscard]] expected<LocalChannel*, CallError> take() noexcept;

 private:
  std::uint32_t message_size_max_;
  /// Has a fixed size; filled from the front.
  std::vector<std::unique_ptr<LocalChannel>> channels_;
  std::atomic<std::size_t> count_{0};
  rt::PiMutex adding_;
};

}  // namespace rtpm::rpc
