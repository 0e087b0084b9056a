#include "page_folder.hpp"

#include <system_error>

namespace rtpm::console {

std::filesystem::path default_page_folder() {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  const fs::path installed = program.parent_path().parent_path() / "share/rtpm/console";
  if (!error && fs::exists(installed / "index.html", error)) return installed;
  return RTPM_CONSOLE_BUILT_PAGE;
}

}  // namespace rtpm::console
