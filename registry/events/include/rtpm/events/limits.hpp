#pragma once

#include <cstdint>
#include <vector>

/// Memory and intake limits of a hub.
namespace rtpm::events {

/// Capacity of the event store by payload size.
struct StoreConfig {
  struct SizeClass {
    std::uint32_t payload_size_max = 0;  ///< In bytes.
    std::uint32_t count = 0;
  };
  /// Sorted by payload_size_max, in ascending order.
  std::vector<SizeClass> classes{{64, 16'384}, {256, 4'096}, {1'024, 1'024},
                                 {4'096, 256}, {16'384, 64}, {65'536, 32}};
};

/// Capacities of an exchange, allocated at construction.
struct ExchangeLimits {
  std::uint32_t subscription_count_max = 1024;
  std::uint32_t interest_count_max = 8192;  ///< The total of all subscriptions.
  std::uint32_t history_key_count_max = 512;
  std::uint32_t history_depth = 8;  ///< Events per type and source for late joiners.
  StoreConfig store{};
};

/// Rate limit of one supplier; `burst_s` is the burst size in seconds of that rate. Excess events
/// are refused and counted.
struct Quota {
  double events_per_s = 2e6;
  double bytes_per_s = 500e6;
  double burst_s = 0.1;
};

}  // namespace rtpm::events
