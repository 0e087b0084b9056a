#include "rtpm/test/alloc_guard.hpp"

// A program on Windows can't replace the malloc of its libraries: tests that rely on the guard skip.
namespace rtpm::test {

bool is_alloc_guard_active() noexcept {
  return false;
}
std::uint64_t allocation_breach_count() noexcept {
  return 0;
}
std::uint64_t thread_allocation_count() noexcept {
  return 0;
}
CountBreachesOnly::CountBreachesOnly() noexcept = default;
CountBreachesOnly::~CountBreachesOnly() = default;

}  // namespace rtpm::test
