#pragma once

#include <vector>

#include "network.hpp"

namespace rtpm::sim {

/// An attacker on the path that sees all datagrams, and sends copies, changed ones and forged ones
/// under any address. It holds some back, and removes features from handshakes; the network causes
/// all other losses and delays.
class Attacker {
 public:
  Attacker(Scheduler& scheduler, Random& random, Network& network)
      : scheduler_(scheduler), random_(random), network_(network) {}

  /// Inspects a datagram; false if the attacker keeps it.
  [[nodiscard]] bool on_datagram(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);
  [[nodiscard]] std::uint64_t forged_count() const { return forged_count_; }
  [[nodiscard]] std::uint64_t held_count() const { return held_count_; }
  [[nodiscard]] std::uint64_t stripped_count() const { return stripped_count_; }

 private:
  struct Recorded {
    std::uint32_t from_port = 0;
    std::uint32_t to_port = 0;
    Bytes frame;
  };
  void record(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);
  void replay();
  void hold(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);
  [[nodiscard]] bool strip(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);
  void change(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);
  void forge(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);
  void send(std::uint32_t from_port, std::uint32_t to_port, Bytes frame);

  Scheduler& scheduler_;
  Random& random_;
  Network& network_;
  std::vector<Recorded> recorded_;
  std::uint64_t forged_count_ = 0;
  std::uint64_t held_count_ = 0;
  std::uint64_t stripped_count_ = 0;
};

}  // namespace rtpm::sim
