#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::console {

/// A lane of a server on this host, with its rates since the previous look.
struct LaneView {
  std::string name{};
  int band_low = 0;
  int band_high = 0;
  std::string schedule{};
  std::string wait{};
  double calls_per_s = 0;
  double drops_per_s = 0;
  double longest_cycle_us = 0;
  std::uint64_t queued_count = 0;
  std::uint32_t busy_count = 0;
};

struct ServerView {
  std::string name{};
  std::string host{};
  int port = 0;
  int process_id = 0;
  bool is_alive = false;
  std::vector<LaneView> lanes{};
};

/// Reads the lanes of all servers on this host, without their cooperation.
/// @threads  one
class LaneWatch {
 public:
  [[nodiscard]] std::vector<ServerView> look();

 private:
  struct Before {
    MonotonicTime when{};
    std::uint64_t call_count = 0;
    std::uint64_t drop_count = 0;
  };
  std::map<std::string, Before> before_{};
};

}  // namespace rtpm::console
