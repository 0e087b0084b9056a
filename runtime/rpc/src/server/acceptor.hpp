#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "lane/lane.hpp"
#include "rtpm/rt/report.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/polled_wait_set.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "rtpm/transport/tcp.hpp"

namespace rtpm::rpc {

/// Takes connections over TCP and through shared memory and hands each to the lane of the priority
/// that it states first; and frees them when they ended. A time-shared thread of its own: nothing
/// here is real-time.
class Acceptor {
 public:
  /// Over TCP, and as many through shared memory, so that no network keeps local clients out.
  static constexpr std::size_t kNewcomerCountMax = 64;
  static constexpr std::size_t kWaitSourceCount = 2 + 2 * kNewcomerCountMax;

  /// `wait_set`: with room for kWaitSourceCount sources.
  Acceptor(transport::TcpListener listener,
           std::optional<transport::SharedMemoryListener> memory_listener,
           std::unique_ptr<transport::WaitSet> wait_set, std::uint32_t message_size_max) noexcept;

  [[nodiscard]] transport::WaitSet& bell() noexcept { return *wait_set_; }

  /// `cpus`: to which it is confined; empty: the starter's.
  [[nodiscard]] expected<void, SetupError> start(std::vector<std::unique_ptr<Lane>>& lanes,
                                                 std::vector<int> cpus);
  /// Ends the thread and closes the port and the connections that no lane has yet.
  void stop() noexcept;

 private:
  struct Newcomer {
    transport::Descriptor socket;
    bool is_memory = false;
    MonotonicTime deadline{};
    wire::PeerAddress host{};
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
  void take_in(transport::Descriptor socket, bool is_memory) noexcept;
  [[nodiscard]] Newcomer& free_place(bool is_memory) noexcept;
  void end(Newcomer& newcomer) noexcept;
  void place(Newcomer& newcomer) noexcept;
  void hand_over(Priority priority, std::unique_ptr<transport::Connection> connection) noexcept;
  void drop_late(MonotonicTime now) noexcept;
  void maintain_lanes() noexcept;

  std::optional<transport::TcpListener> listener_;                  ///< None once stopped.
  std::optional<transport::SharedMemoryListener> memory_listener_;  ///< Likewise; or not wanted.
  std::unique_ptr<transport::WaitSet> wait_set_;
  std::uint32_t message_size_max_;
  MonotonicTime listening_from_ = MonotonicTime::min();  ///< Later: the listeners are not polled.
  rt::RepeatedWarning shortage_warning_{};
  std::vector<std::unique_ptr<Lane>>* lanes_ = nullptr;
  std::vector<Newcomer> newcomers_;
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_;
};

}  // namespace rtpm::rpc
