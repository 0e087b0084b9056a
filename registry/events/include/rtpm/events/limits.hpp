#pragma once

#include <cstdint>
#include <vector>

/// What a hub holds and takes in at most.
namespace rtpm::events {

/// How many events a store holds, by the size of their payloads.
struct StoreConfig {
  struct SizeClass {
    std::uint32_t payload_size_max = 0;  ///< Bytes.
    std::uint32_t count = 0;
  };
  std::vector<SizeClass> classes{{64, 16'384}, {256, 4'096}, {1'024, 1'024},
                                 {4'096, 256}, {16'384, 64}, {65'536, 32}};  ///< Ascending.
};

/// What an exchange holds at most; all of it is taken when built.
struct ExchangeLimits {
  std::uint32_t subscription_count_max = 1024;
  std::uint32_t interest_count_max = 8192;  ///< Of all subscriptions together.
  std::uint32_t history_key_count_max = 512;
  std::uint32_t history_depth = 8;  ///< Events of each type and source that late joiners get.
  StoreConfig store{};
};

/// How much one supplier may push: so many events and bytes a second, and `burst_s` seconds' worth
/// at once. What is above is refused and counted, so that who floods harms only itself.
struct Quota {
  double events_per_s = 2e6;
  double bytes_per_s = 500e6;
  double burst_s = 0.1;
};

}  // namespace rtpm::events
