#pragma once

#include <map>
#include <optional>
#include <string>

#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::exports {

/// The devices that the recording describes, by name; those of another version of RTPM's schema are
/// left out.
[[nodiscard]] expected<std::map<std::string, driver::Descriptor>, SetupError> read_devices(
    recording::FileReader& reader, const recording::Progress& progress);

/// Whether the channel has samples of this version of RTPM's schema.
[[nodiscard]] bool has_samples(const recording::FileReader& reader,
                               const recording::Channel& channel);

/// The sample of a message of such a channel; nullopt if it is broken.
[[nodiscard]] std::optional<driver::Sample> sample_of(const recording::Message& message);

}  // namespace rtpm::exports
