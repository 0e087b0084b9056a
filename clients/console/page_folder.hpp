#pragma once

#include <filesystem>

namespace rtpm::console {

/// The page's folder: the one installed next to the program, otherwise this build's.
[[nodiscard]] std::filesystem::path default_page_folder();

}  // namespace rtpm::console
