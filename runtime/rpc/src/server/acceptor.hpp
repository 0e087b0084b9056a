#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "calls/refusal_notes.hpp"
#include "lane/lane.hpp"
#include "rtpm/rt/report.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/wait_set.hpp"
#include "security/exposure.hpp"

namespace rtpm::rpc {

/// Accepts connections over TCP and shared memory, hands each to the lane of the priority in its
/// first frame, and frees ended ones. Runs on its own time-shared thread: nothing here is
/// real-time.
class Acceptor {
 public:
  /// The limit for TCP, and separately for shared memory, so that no network client locks out local
  /// ones.
  static constexpr std::size_t kNewcomerCountMax = 64;
  /// How many sources it waits for, with this many listeners of both kinds.
  [[nodiscard]] static constexpr std::size_t wait_source_count(
      std::size_t listener_count) noexcept {
    return listener_count + 2 * kNewcomerCountMax;
  }

  /// @param listeners  at least one
  /// @param wait_set   takes wait_source_count() sources
  /// @param users      the users that memory is shared with; null for the server's own user and
  ///           root
  Acceptor(std::vector<transport::TcpListener> listeners,
           std::vector<transport::SharedMemoryListener> memory_listeners,
           std::unique_ptr<transport::WaitSet> wait_set, std::uint32_t message_size_max,
           const transport::UserPolicy* users) noexcept;

  [[nodiscard]] transport::WaitSet& bell() noexcept { return *wait_set_; }
  /// Lanes note refusals here; the acceptor's thread writes them.
  [[nodiscard]] RefusalNotes& refusals() noexcept { return refusals_; }

  /// Lets its thread repeat the warning. Call before start().
  void warn_each_minute(OpenWarning warning) { open_warning_.emplace(std::move(warning)); }
  /// @param cpus  the CPUs that the thread is confined to; if empty, those of the starting thread
  [[nodiscard]] expected<void, SetupError> start(std::vector<std::unique_ptr<Lane>>& lanes,
                                                 std::vector<int> cpus);
  /// Ends the thread, and closes the port and the connections that no lane has yet.
  void stop() noexcept;

 private:
  struct Newcomer {
    transport::Descriptor socket;
    bool is_memory = false;
    MonotonicTime deadline{};
    wire::PeerAddress host{};
    /// The system reports a part of a header, too; until the whole is there, it is looked for now
    /// and then, as the part would be reported again and again.
    bool may_be_part = false;
    MonotonicTime next_look = kNever;
  };
  static constexpr transport::SourceKind kListener{1};
  static constexpr transport::SourceKind kMemoryListener{2};
  static constexpr transport::SourceKind kNewcomer{3};

  void run() noexcept;
  template <class Listener>
  void accept_some(Listener& listener, bool is_memory) noexcept;
  void note_shortage(int error, const char* what) noexcept;
  void pause_listening(MonotonicTime now) noexcept;
  [[nodiscard]] bool listen() noexcept;
  void take_in(transport::Descriptor socket, bool is_memory, bool may_be_part) noexcept;
  [[nodiscard]] Newcomer& free_place(bool is_memory) noexcept;
  void end(Newcomer& newcomer) noexcept;
  void place(Newcomer& newcomer) noexcept;
  void hand_over(Priority priority, std::unique_ptr<transport::Connection> connection) noexcept;
  void attend_newcomers(MonotonicTime now) noexcept;
  void maintain_lanes() noexcept;

  std::vector<transport::TcpListener> listeners_;                  ///< Empty once stopped.
  std::vector<transport::SharedMemoryListener> memory_listeners_;  ///< May be empty.
  std::unique_ptr<transport::WaitSet> wait_set_;
  RefusalNotes refusals_{*wait_set_};
  std::uint32_t message_size_max_;
  const transport::UserPolicy* users_;
  /// If later than now, the listeners are not polled.
  MonotonicTime listening_from_ = MonotonicTime::min();
  rt::RepeatedWarning shortage_warning_{};
  std::optional<OpenWarning> open_warning_{};
  std::vector<std::unique_ptr<Lane>>* lanes_ = nullptr;
  std::vector<Newcomer> newcomers_;
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_;
};

}  // namespace rtpm::rpc
