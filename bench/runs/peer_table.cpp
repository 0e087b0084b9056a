#include "runs/peer_table.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <sstream>

namespace rtpm::bench {

std::span<const PeerEntry> known_peers() {
  static constexpr std::array kPeers{
      PeerEntry{"omniorb", "libomniorb4-dev omniidl", "tcp unix", ""},
      PeerEntry{"ice", "libzeroc-ice-dev zeroc-ice-compilers", "tcp", ""},
      PeerEntry{"grpc", "libgrpc++-dev protobuf-compiler-grpc libprotobuf-dev protobuf-compiler",
                "tcp unix", ""},
      PeerEntry{"capnproto", "libcapnp-dev capnproto", "tcp unix", ""},
      PeerEntry{"zeromq", "libzmq3-dev", "tcp ipc", "tcp ipc", true},
      PeerEntry{"nng", "libnng-dev", "tcp ipc", "tcp ipc", true},
      PeerEntry{"cyclonedds", "cyclonedds-dev cyclonedds-tools", "udp", "udp"},
      PeerEntry{"fastdds", "libfastrtps-dev libfastcdr-dev", "udp shm", "udp shm"},
      PeerEntry{"lcm", "liblcm-dev", "udp", "udp"},
      PeerEntry{"mosquitto", "mosquitto libmosquitto-dev", "", "tcp unix", true},
      PeerEntry{"omnievents", "omnievents libomnievents-dev libcos4-dev libomniorb4-dev", "", "tcp",
                true},
      PeerEntry{"nats", "nats-server libnats-dev", "", "tcp", true},
  };
  return kPeers;
}

expected<PeerChoice, std::string> choose_peers(const std::vector<std::string>& names) {
  PeerChoice choice;
  for (const std::string& name : names) {
    if (name == "all") {
      choice.peers.clear();
      for (const PeerEntry& peer : known_peers())
        choice.peers.push_back(&peer);
      choice.is_by_name = false;
      return choice;
    }
    const auto found = std::ranges::find(known_peers(), name, &PeerEntry::name);
    if (found == known_peers().end()) return unexpected{name};
    choice.peers.push_back(&*found);
    choice.is_by_name = true;
  }
  return choice;
}

std::string peer_names() {
  std::string names;
  for (const PeerEntry& peer : known_peers())
    names += (names.empty() ? "" : ", ") + std::string(peer.name);
  return names;
}

std::optional<std::string> find_program(const PeerEntry& peer) {
  std::error_code error;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", error);
  const auto path = self.parent_path() / ("rtpm-peer-" + std::string(peer.name));
  if (error || !std::filesystem::exists(path, error)) return std::nullopt;
  return path.string();
}

std::string missing_text(const PeerEntry& peer) {
  return "is not built, as rtpm-peer-" + std::string(peer.name) +
         " is not beside this program. Remedy: apt-get install " + std::string(peer.packages) +
         ", and build with -DRTPM_BENCH_PEERS=ON.";
}

bool is_beside(std::string_view transport, Carrier carrier) noexcept {
  if (transport == "tcp") return carrier != Carrier::kSharedMemory;
  if (transport == "udp") return carrier == Carrier::kUdp;
  return carrier == Carrier::kSharedMemory;
}

std::vector<std::string> transports_beside(std::string_view transports, Carrier carrier) {
  std::vector<std::string> chosen;
  std::istringstream words{std::string(transports)};
  for (std::string word; words >> word;) {
    if (is_beside(word, carrier)) chosen.push_back(word);
  }
  return chosen;
}

}  // namespace rtpm::bench
