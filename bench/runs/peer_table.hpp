#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "settings.hpp"

namespace rtpm::bench {

/// Another middleware that RTPM can be measured with. Its program is rtpm-peer-NAME.
struct PeerEntry {
  std::string_view name;
  std::string_view packages;         ///< Debian's, by which it is built and runs.
  std::string_view call_transports;  ///< Separated by blanks; empty: it makes no calls.
  std::string_view event_transports;
  bool has_broker = false;  ///< Its events pass through a process of their own.
};

/// All that RTPM knows, in the order in which they are shown.
[[nodiscard]] std::span<const PeerEntry> known_peers();

/// Peers that a run asks for, and whether each was asked for by its name.
struct PeerChoice {
  std::vector<const PeerEntry*> peers{};
  bool is_by_name = false;
};
/// What --peers asks for: "all", or names.
/// @return the first text that is neither, if any.
[[nodiscard]] expected<PeerChoice, std::string> choose_peers(const std::vector<std::string>& names);
/// Every name, separated by commas.
[[nodiscard]] std::string peer_names();

/// The path of a peer's program, which is built beside rtpm-bench; nothing if it is not there.
/// Set-up only.
[[nodiscard]] std::optional<std::string> find_program(const PeerEntry& peer);
/// Why a peer is left out: one sentence with its packages.
[[nodiscard]] std::string missing_text(const PeerEntry& peer);

/// Whether a peer's transport is measured beside that carrier of RTPM's: TCP beside UDP and TCP,
/// UDP beside UDP, and what stays within the host ("ipc", "unix", "shm") beside shared memory.
[[nodiscard]] bool is_beside(std::string_view transport, Carrier carrier) noexcept;
/// Those of `transports` that are measured beside `carrier`.
[[nodiscard]] std::vector<std::string> transports_beside(std::string_view transports,
                                                         Carrier carrier);

}  // namespace rtpm::bench
