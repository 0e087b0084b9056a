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

// Calls to objects that the same program serves: no frame, no socket; the lane that would serve the
// call from elsewhere runs it, on memory that both sides see.
namespace rtpm::rpc {

class LocalChannel;
class LocalOneways;

/// The lane behind a gate.
class LocalHost {
 public:
  /// Runs a method inside of another method of this lane, on that one's thread.
  /// @threads  the lane's that runs the other method
  [[nodiscard]] virtual DispatchResult run_nested(const LocalChannel& channel) noexcept = 0;

 protected:
  ~LocalHost() = default;
};

/// The parameters of a local call beside its request.
struct LocalCallParameters {
  std::uint32_t service = 0;
  std::uint16_t method = 0;
  Priority priority{};
  std::uint64_t session = 0;  ///< The binding's number, not a session on a wire.
  std::uint64_t trace_id = 0;
  MonotonicTime deadline{};
  std::uint32_t message_size_max = 0;  ///< The smaller limit of the node and the server.
};

/// The memory of one local call at a time. Its caller has it, then the lane, then the caller again;
/// if the caller gives up meanwhile, the lane has it until it is done. The lane has that of a
/// oneway from the beginning.
/// @threads  try_take() any; the lane's part the lane's; the rest the thread that took it
/// @realtime alloc-free but for construction; at most one syscall a side, to wake or to wait
class LocalChannel {
 public:
  explicit LocalChannel(std::uint32_t message_size_max);
  /// A place of `home`, which has the memory; `number` is the place's there.
  LocalChannel(MutableBytes request_room, MutableBytes reply_room, LocalOneways& home,
               std::uint32_t number) noexcept
      : request_room_(request_room), reply_room_(reply_room), home_(&home), number_(number) {}

  [[nodiscard]] bool try_take() noexcept {
    State free = State::kFree;
    return state_.compare_exchange_strong(free, State::kTaken, std::memory_order_acquire);
  }
  void release() noexcept { state_.store(State::kFree, std::memory_order_release); }
  [[nodiscard]] std::uint32_t number() const noexcept { return number_; }
  /// Free.
  [[nodiscard]] bool is_free() const noexcept {
    return state_.load(std::memory_order_acquire) == State::kFree;
  }

  /// Gives back a channel or a place that was not submitted.
  void give_up() noexcept;

  /// Copies the request; false if it is too large.
  [[nodiscard]] bool write(const LocalCallParameters& parameters, ConstBytes request) noexcept;
  /// The lane may have it from now on. `is_awaited`: the caller waits.
  void submit(bool is_awaited) noexcept {
    state_.store(is_awaited ? State::kSubmitted : State::kLeft, std::memory_order_release);
  }
  /// Waits until the lane is done; false after the deadline: then the lane has the channel.
  [[nodiscard]] bool wait(const rt::WaitConfig& how) noexcept;
  [[nodiscard]] wire::Status status() const noexcept { return status_; }
  [[nodiscard]] ConstBytes result() const noexcept { return reply_room_.first(size_); }

  // The lane calls the functions below.
  [[nodiscard]] const LocalCallParameters& parameters() const noexcept { return parameters_; }
  [[nodiscard]] ConstBytes request() const noexcept { return request_room_.first(request_size_); }
  [[nodiscard]] MutableBytes reply() const noexcept {
    return reply_room_.first(parameters_.message_size_max);
  }
  /// Whether it is a place for oneways: nobody reads its reply().
  [[nodiscard]] bool is_place() const noexcept { return home_ != nullptr; }
  /// Gives it back to the caller, or frees it.
  void finish(wire::Status status, std::uint32_t size) noexcept;

  std::atomic<LocalChannel*> next_ready{nullptr};

 private:
  enum class State : std::uint8_t {
    kFree,
    kTaken,
    kSubmitted,  ///< The lane has it; the caller polls.
    kWaiting,    ///< The lane has it; the caller sleeps.
    kLeft,       ///< The lane has it; its caller no longer waits.
    kDone,
  };

  LocalCallParameters parameters_{};
  rt::LazyMemory request_;  ///< The channel's memory, unless it is a place.
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

/// Where local calls enter a lane. It may outlive the lane.
/// @threads  submit(), take_place(), open_places() and is_closed() any; the rest the lane's
/// @realtime alloc-free but for open_places()
class LocalGate {
 public:
  /// `oneway_count_max`: how many oneways may wait or run.
  LocalGate(std::shared_ptr<Doorbell> bell, LocalHost& host, std::uint32_t oneway_count_max,
            std::uint32_t message_size_max) noexcept;
  LocalGate(const LocalGate&) = delete;
  LocalGate& operator=(const LocalGate&) = delete;
  ~LocalGate();

  void submit(LocalChannel& call, bool is_awaited) noexcept;
  /// Makes the places for oneways, unless they are there.
  /// @realtime set-up only
  void open_places();
  /// Whether a oneway of that size has places of its own.
  [[nodiscard]] bool has_places_for(std::size_t size) const noexcept;
  /// One of them; null if oneways wait or run in all, which the lane counts as overload.
  /// Allocates at first, unless the places were opened.
  [[nodiscard]] LocalChannel* take_place() noexcept;

  [[nodiscard]] bool has_calls() const noexcept {
    return !calls_.is_empty() || refused_count_.load(std::memory_order_relaxed) > 0;
  }
  [[nodiscard]] bool may_sleep() const noexcept {
    return calls_.is_empty_before_sleep() && refused_count_.load(std::memory_order_seq_cst) == 0;
  }
  /// The call that came first, or null.
  [[nodiscard]] LocalChannel* take_next() noexcept { return calls_.take_next(); }
  /// How many oneways found no place since it was last asked.
  [[nodiscard]] std::uint32_t take_refused_count() noexcept;
  /// From here on calls end with kStopping.
  void close() noexcept;
  [[nodiscard]] bool is_closed() const noexcept {
    return is_closed_.load(std::memory_order_relaxed);
  }
  /// Only to be compared, or used on the lane's own thread.
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

/// A server as callers of the same program see it, found by its epoch while it runs.
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
  /// Makes the places for oneways of these priorities; of all, if there are none.
  void open_places(std::span<const Priority> priorities) const;

  static void open(const std::shared_ptr<LocalDoor>& door);
  static void close(const LocalDoor& door) noexcept;
  /// The running server of this program with that epoch, or null.
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
  /// A number for a binding's parameters.
  [[nodiscard]] static std::uint64_t next_session() noexcept;

  LocalChannels(std::uint32_t count_max, std::uint32_t message_size_max);
  LocalChannels(const LocalChannels&) = delete;
  LocalChannels& operator=(const LocalChannels&) = delete;
  /// Channels that a lane still has are kept until it is done.
  ~LocalChannels();

  [[nodiscard]] expected<LocalChannel*, CallError> take() noexcept;

 private:
  std::uint32_t message_size_max_;
  std::vector<std::unique_ptr<LocalChannel>> channels_;  ///< Sized once; filled from the front.
  std::atomic<std::size_t> count_{0};
  rt::PiMutex adding_;
};

}  // namespace rtpm::rpc
