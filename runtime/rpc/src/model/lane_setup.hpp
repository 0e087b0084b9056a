#pragma once

#include <cstddef>
#include <cstdint>

#include "model/object_table.hpp"
#include "rtpm/base/hash.hpp"
#include "rtpm/rpc/lane_table.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/sealed/handshake_job.hpp"
#include "rtpm/transport/wait_set.hpp"

namespace rtpm::rpc {

class AccessControl;
class AuditLog;
class HandshakeRate;
class PooledExecution;
class RefusalNotes;

/// How many sources a lane with these sessions waits for: a connection has a socket and an event.
[[nodiscard]] constexpr std::size_t wait_source_count(std::uint32_t session_count_max,
                                                      std::size_t port_count = 1) noexcept {
  return port_count + 4 * std::size_t{session_count_max};
}

/// The parts that a lane is built from. All must outlive the lane.
struct LaneSetup {
  const ServerConfig* server = nullptr;  ///< Its lanes are sorted by band.
  std::uint32_t number = 0;              ///< The lane's index among them.
  std::uint64_t epoch = 0;               ///< The server's epoch.
  std::uint64_t clock_domain = 0;
  SipKey key{};  ///< The secret of the server's sessions.
  const ObjectTable* objects = nullptr;
  PooledExecution* lower = nullptr;         ///< The threads of the lane below, if it borrows.
  std::uint32_t lendable_thread_count = 0;  ///< The total of all lower lanes.
  /// The bell of the thread that frees ended connections and starts threads.
  transport::WaitSet* acceptor_bell = nullptr;
  RefusalNotes* refusals = nullptr;       ///< Written by the acceptor's thread.
  LaneSlot* slot = nullptr;               ///< The lane's slot of the lane table.
  const AccessControl* access = nullptr;  ///< Null if the server does not authenticate callers.
  // The members below are set only with `access`.
  AuditLog* audit = nullptr;
  const sealed::ServerIdentity* identity = nullptr;
  HandshakeRate* handshake_rate = nullptr;
  transport::WaitSet* gatekeeper_bell = nullptr;

  [[nodiscard]] const LaneConfig& config() const noexcept { return server->lanes[number]; }
  [[nodiscard]] Band band() const noexcept {
    const bool is_last = number + 1 == server->lanes.size();
    return {config().low, is_last ? Priority{Priority::kHighest}
                                  : Priority{server->lanes[number + 1].low.value() - 1}};
  }
};

}  // namespace rtpm::rpc
