#pragma once

#include <chrono>
#include <cstddef>

#include "rtpm/base/time.hpp"

namespace rtpm::names {

/// Capacities of a registry.
struct Limits {
  std::size_t name_count_max = 4096;
  std::size_t name_count_per_owner_max = 256;
  /// Names and owners of names, per remote host.
  std::size_t name_count_per_host_max = 512;
  std::size_t owner_count_per_host_max = 128;
  /// The limits for the registry's own host.
  std::size_t name_count_own_host_max = 2048;
  std::size_t owner_count_own_host_max = 512;
  /// Bytes of properties: of one binding, of all bindings of an owner, and in total.
  std::size_t property_byte_max = std::size_t{4} * 1024;
  std::size_t property_byte_per_owner_max = std::size_t{256} * 1024;
  std::size_t property_byte_in_all_max = std::size_t{64} * 1024 * 1024;
  /// Watches in total, and per remote host.
  std::size_t watch_count_max = 256;
  std::size_t watch_count_per_host_max = 64;
  /// How many changes a watch may lag behind before it is cut off, and how many the registry keeps
  /// so that a watch can resume.
  std::size_t watch_backlog_max = 4096;
  std::size_t history_count_max = 16384;
  std::size_t history_byte_max = std::size_t{16} * 1024 * 1024;
  Duration lease_min = std::chrono::milliseconds{100};
  Duration lease_max = std::chrono::hours{1};
  /// The maximum lease of a name until it has been held for that long, so that unrenewed names
  /// expire soon.
  Duration first_lease_max = std::chrono::seconds{10};
};

}  // namespace rtpm::names
