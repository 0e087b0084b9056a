#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "figures/report.hpp"
#include "outcome.hpp"
#include "runs/peer_link.hpp"
#include "runs/turn.hpp"
#include "settings.hpp"

namespace rtpm::bench {

/// Another middleware that RTPM can be measured with. Its program is rtpm-peer-NAME.
struct PeerEntry {
  std::string_view name;
  std::string_view packages;          ///< Debian packages that it needs to build and run.
  std::string_view call_transports;   ///< Separated by blanks.
  std::string_view event_transports;  ///< Likewise; empty without events.
  bool has_broker = false;            ///< Its events pass through a process of their own.

  /// The transports for `verb` ("call" or "events") that are measured beside RTPM on `carrier`:
  /// TCP beside UDP and TCP, UDP beside UDP, and the ones within the host ("ipc", "unix", "shm")
  /// beside shared memory.
  [[nodiscard]] std::vector<std::string> transports(std::string_view verb, Carrier carrier) const;
};

/// All peers that RTPM knows, in the order of display.
[[nodiscard]] std::span<const PeerEntry> known_peers();

/// The peers that `settings` asks for.
[[nodiscard]] std::vector<const PeerEntry*> chosen_peers(const Settings& settings);

/// Says on standard error which of the peers asked for are not built, with their packages. The
/// report lacks those that were asked for by name.
void say_missing_peers(const Settings& settings, Report& report);

/// The path of a peer's program, which is built beside rtpm-bench; nullopt if it is not there.
/// @realtime set-up only
[[nodiscard]] std::optional<std::string> find_program(const PeerEntry& peer);

/// Starts a peer with its server and its client, each a process, which are both stopped except in
/// the peer's turns. Call it before this process starts a thread.
/// @param verb  what the client does, "call" or "events"
/// @realtime    set-up only
[[nodiscard]] Outcome<Contender> start_peer(const std::string& program, const std::string& verb,
                                            const PeerSetting& setting);

}  // namespace rtpm::bench
