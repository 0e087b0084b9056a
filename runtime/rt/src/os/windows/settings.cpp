#include "rtpm/rt/survey.hpp"

// This system has no settings in files, so no finding has any.
namespace rtpm::rt {

std::optional<Change> apply(const Setting& setting, bool) {
  return Change{.path = setting.path,
                .from = {},
                .to = setting.value,
                .problem = "this system has no settings in files"};
}

}  // namespace rtpm::rt
