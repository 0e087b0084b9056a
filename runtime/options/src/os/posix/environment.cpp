#include "os/environment.hpp"

#include <unistd.h>

namespace rtpm::options::os {

std::vector<std::string> environment() {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable)
    variables.emplace_back(*variable);
  return variables;
}

}  // namespace rtpm::options::os
