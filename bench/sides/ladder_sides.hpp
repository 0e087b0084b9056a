#pragma once

#include <memory>
#include <string>

#include "rtpm/base/expected.hpp"
#include "sides/event_sides.hpp"
#include "sides/server_process.hpp"

/// The cost of an event's way without any hub: calls alone.
namespace rtpm::bench {

/// Starts an echo server in a process of its own, for direct_calls().
[[nodiscard]] expected<ServerProcess, std::string> start_direct(const EventSetting& setting);
/// An event is a call there and back; its consumer is the caller, which has the event when the
/// reply arrives.
/// @lifetime refers to `board`
[[nodiscard]] expected<std::unique_ptr<EventSide>, std::string> direct_calls(
    const EventSetting& setting, const std::string& server, EventBoard& board);

/// An event is a call without reply to another process, which makes another such call back, to an
/// object of this process that records it.
class CallbackChain {
 public:
  /// Opens the object that is called back, and starts the other process, which looks for it. Make
  /// it before this process starts a thread.
  [[nodiscard]] static expected<std::unique_ptr<CallbackChain>, std::string> start(
      const EventSetting& setting, EventBoard& board);
  virtual ~CallbackChain() = default;

  /// Serves the object and waits until the first stamp came the whole way.
  [[nodiscard]] virtual expected<std::unique_ptr<EventSide>, std::string> connect() = 0;
  [[nodiscard]] virtual pid_t id() const = 0;
};

}  // namespace rtpm::bench
