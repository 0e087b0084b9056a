#pragma once

#include <filesystem>

namespace rtpm::console {

/// Where the page is: installed beside the program, else where this build has it.
[[nodiscard]] std::filesystem::path default_page_folder();

}  // namespace rtpm::console
