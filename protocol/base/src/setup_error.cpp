#include "rtpm/base/setup_error.hpp"

#include "rtpm/base/printable.hpp"

namespace rtpm::inline base {

std::string SetupError::text() const {
  const auto ended = [](std::string clause) {
    return clause.ends_with('.') ? clause : clause + '.';
  };
  const std::string text = ended(reason());
  return printable(remedy.empty() ? text : text + " Remedy: " + ended(remedy), kShownWhole);
}

}  // namespace rtpm::inline base
