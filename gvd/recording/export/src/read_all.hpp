#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "rtpm/exports/export.hpp"

namespace rtpm::exports {

/// Converts the messages of a query until one fails or `progress` ends it.
/// @param convert  takes a Message, and returns expected<void, SetupError>
/// @param goal  the failure's first clause if it was ended: "the recording was not exported"
template <class Convert>
[[nodiscard]] expected<void, SetupError> read_all(recording::FileReader& reader,
                                                  const recording::Query& query,
                                                  const recording::Progress& progress,
                                                  const std::string& goal, Convert convert) {
  // Messages between two reports of progress.
  constexpr std::uint64_t kProgressStep = 256;
  expected<void, SetupError> done{};
  std::uint64_t count = 0;
  const std::uint64_t whole = reader.statistics().message_count;
  const auto read = reader.read(
      query,
      [&](const recording::Message& message) {
        done = convert(message);
        if (done && progress && ++count % kProgressStep == 0 &&
            !progress(std::min(count, whole), whole))
          done = setup_error(goal, "it was stopped");
        return done.has_value();
      },
      progress);
  return read ? done : read;
}

}  // namespace rtpm::exports
