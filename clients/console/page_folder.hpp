#pragma once

#include <filesystem>

namespace rtpm::console {

/// The page's folder: the one installed beside the program, otherwise that of this build.
[[nodiscard]] std::filesystem::path default_page_folder();

}  // namespace rtpm::console
