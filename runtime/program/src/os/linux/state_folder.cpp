#include "rtpm/program/state_folder.hpp"

#include <cstdlib>

namespace rtpm::program {
namespace {

/// An absolute path; a relative one counts for nothing, as the XDG specification demands.
std::string path_in(const char* variable) {
  const char* const path = std::getenv(variable);  // NOLINT(concurrency-mt-unsafe): set-up.
  return path != nullptr && *path == '/' ? std::string(path) : std::string();
}

}  // namespace

std::string state_folder() {
  const std::string state = path_in("XDG_STATE_HOME");
  if (!state.empty()) return state + "/rtpm";
  const std::string home = path_in("HOME");
  return home.empty() ? "" : home + "/.local/state/rtpm";
}

}  // namespace rtpm::program
