#include "rtpm/base/assert.hpp"

#include <cstdio>
#include <cstdlib>

namespace rtpm::inline base {

void assertion_failed(const char* expression, const char* message, const char* file,
                      int line) noexcept {
  std::fprintf(stderr, "rtpm: bug: %s (%s does not hold) at %s:%d\n", message, expression, file,
               line);
  std::abort();
}

}  // namespace rtpm::inline base
