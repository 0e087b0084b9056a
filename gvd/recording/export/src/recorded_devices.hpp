#pragma once

#include <optional>

#include "rtpm/driver/sample.hpp"
#include "rtpm/exports/scalars.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::exports {

/// Whether the channel has samples of this version of RTPM's schema.
[[nodiscard]] bool has_samples(const recording::FileReader& reader,
                               const recording::Channel& channel);

/// The sample of a message of such a channel; nullopt if it is broken.
[[nodiscard]] std::optional<driver::Sample> sample_of(const recording::Message& message);

}  // namespace rtpm::exports
