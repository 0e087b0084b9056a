#pragma once

#include <cstdint>

#include "model/object_table.hpp"
#include "rtpm/rpc/lane_table.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/sealed/handshake_job.hpp"
#include "rtpm/transport/wait_set.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::rpc {

class AccessControl;
class AuditLog;
class HandshakeRate;
class PooledExecution;
class RefusalNotes;

/// The sources that a lane with these sessions waits for: a connection has a socket and an event.
[[nodiscard]] constexpr std::size_t wait_source_count(std::uint32_t session_count_max,
                                                      std::size_t port_count = 1) noexcept {
  return port_count + 4 * std::size_t{session_count_max};
}

/// The parts that a lane is built from.
struct LaneSetup {
  LaneConfig config{};
  Band band{};
  wire::ServerSessionsConfig sessions{};  ///< Those of streams; others differ in medium and size.
  const ObjectTable* objects = nullptr;
  std::uint32_t large_message_count_max = 0;
  std::uint32_t deferred_call_count_max = 0;
  std::uint32_t stream_count_max = 0;
  std::uint32_t stream_byte_max = 0;
  std::uint32_t local_oneway_count_max = 0;
  PriorityTransform inbound_priority = nullptr;
  PooledExecution* lower = nullptr;         ///< The threads of the lane below, if it borrows.
  bool borrows = false;                     ///< Whether it borrows or lends threads.
  std::uint32_t lendable_thread_count = 0;  ///< The sum over all lanes below.
  /// The bell of the thread that frees ended connections and starts threads.
  transport::WaitSet* acceptor_bell = nullptr;
  RefusalNotes* refusals = nullptr;       ///< Written by the same thread.
  LaneSlot* slot = nullptr;               ///< Its slot of the lane table.
  const AccessControl* access = nullptr;  ///< Null if the server asks nobody.
  // The members below are used with `access`.
  AuditLog* audit = nullptr;
  const sealed::ServerIdentity* identity = nullptr;
  HandshakeRate* handshake_rate = nullptr;
  transport::WaitSet* gatekeeper_bell = nullptr;
};

}  // namespace rtpm::rpc
