#include "host/lane_text.hpp"

#include <array>
#include <cstdio>
#include <utility>

#include "rtpm/base/printable.hpp"

namespace rtpm::tool {

std::string time_text(std::int64_t ns) {
  constexpr std::array<std::pair<std::int64_t, const char*>, 3> kUnits{
      {{1'000'000'000, "s"}, {1'000'000, "ms"}, {1'000, "us"}}};
  std::array<char, 32> text{};
  for (const auto& [size, name] : kUnits) {
    if (ns < size) continue;
    std::snprintf(text.data(), text.size(), "%.1f %s",
                  static_cast<double>(ns) / static_cast<double>(size), name);
    return text.data();
  }
  return std::to_string(ns) + " ns";
}

std::uint64_t dropped_count(const wire::FrameCounters& frames) {
  std::uint64_t sum = 0;
  for (const std::uint64_t count : frames.dropped)
    sum += count;
  return sum;
}

std::string server_text(const rpc::LaneTable& table) {
  return printable(table.server_name() + "@" + table.host()) + ":" + std::to_string(table.port());
}

}  // namespace rtpm::tool
