#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"

/// The texts of which CSV files are made.
namespace rtpm::exports {

/// "lab_arm0_sampled", from "lab/arm0/sampled".
[[nodiscard]] std::string file_stem(const std::string& topic);

/// Appends a cell that is not a number: in quotation marks where RFC 4180 demands them. A text that
/// a spreadsheet would run as a formula gets an apostrophe.
void append_text_cell(std::string& line, std::string_view text);

/// "2026-11-24T08:15:30.250123456Z".
[[nodiscard]] std::string time_text(std::uint64_t ns);

/// Seconds from `begin_ns`, with all digits: "-0.000000001".
[[nodiscard]] std::string seconds_text(std::uint64_t ns, std::uint64_t begin_ns);

/// Opens the file for each text, as a recording can have more channels than a process files.
[[nodiscard]] expected<void, SetupError> append_to_file(const std::filesystem::path& path,
                                                        std::string_view text);

/// Whether `text` is of the pattern, in which `*` is any text and `?` any character.
[[nodiscard]] bool is_like(std::string_view text, std::string_view pattern) noexcept;

}  // namespace rtpm::exports
