#pragma once

#include <vector>

#include "network.hpp"

namespace rtpm::sim {

/// Someone on the way who sees all datagrams, and sends copies, changed ones and forged ones under
/// any address. What he drops and delays is the network's part.
class Attacker {
 public:
  Attacker(Scheduler& scheduler, Random& random, Network& network)
      : scheduler_(scheduler), random_(random), network_(network) {}

  /// Looks at a datagram.
  void on_datagram(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);
  [[nodiscard]] std::uint64_t forged_count() const { return forged_count_; }

 private:
  struct Recorded {
    std::uint32_t from_port = 0;
    std::uint32_t to_port = 0;
    Bytes frame;
  };
  void record(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);
  void replay();
  void change(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);
  void forge(std::uint32_t from_port, std::uint32_t to_port, ConstBytes frame);
  void send(std::uint32_t from_port, std::uint32_t to_port, Bytes frame);

  Scheduler& scheduler_;
  Random& random_;
  Network& network_;
  std::vector<Recorded> recorded_;
  std::uint64_t forged_count_ = 0;
};

}  // namespace rtpm::sim
