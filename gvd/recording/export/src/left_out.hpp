#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/exports/export.hpp"

namespace rtpm::exports {

/// Counts what was not converted, by topic and reason.
class LeftOutCounter {
 public:
  void add(const std::string& topic, const std::string& reason, std::uint64_t message_count);
  [[nodiscard]] std::vector<LeftOut> all() const;

 private:
  std::map<std::pair<std::string, std::string>, std::uint64_t> counts_{};
};

/// The number of messages of a channel, as the file states it.
[[nodiscard]] std::uint64_t count_of(const recording::FileReader& reader, std::uint16_t channel);

/// Whether the channel only repeats samples for viewers.
[[nodiscard]] bool is_view(const recording::Channel& channel);

inline constexpr const char* kBrokenMessage = "they do not match its schema";

}  // namespace rtpm::exports
