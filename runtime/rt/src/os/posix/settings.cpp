#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "rtpm/rt/survey.hpp"
#include "survey/host_tree.hpp"
#include "survey/judgements.hpp"

namespace rtpm::rt {
namespace {

/// The value in effect: the word in brackets of "always [madvise] never".
std::string value_in(const std::string& path) {
  const std::string text = HostTree("").text(path);
  const std::string chosen = chosen_of(text);
  return chosen.empty() ? text : chosen;
}

/// Writes `value`; returns the error text, or an empty text.
std::string write_to(const std::string& path, const std::string& value) {
  const int file = ::open(path.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
  int error = file < 0 ? errno : 0;
  if (file >= 0) {
    if (::write(file, value.data(), value.size()) < 0) error = errno;
    ::close(file);
  }
  if (error == 0) return {};
  const bool lacks_right = error == EACCES || error == EPERM;
  return std::string(std::strerror(error)) + (lacks_right ? "; it needs root" : "");
}

}  // namespace

std::optional<Change> apply(const Setting& setting, bool is_dry) {
  Change change{.path = setting.path, .from = value_in(setting.path), .to = setting.value};
  if (change.from == change.to) return std::nullopt;
  if (is_dry) return change;
  change.problem = write_to(setting.path, setting.value);
  if (!change.problem.empty()) return change;
  const std::string now = value_in(setting.path);
  if (now != setting.value) change.problem = "the system keeps '" + now + "'";
  return change;
}

}  // namespace rtpm::rt
