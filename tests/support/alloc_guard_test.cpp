#include "rtpm/test/alloc_guard.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/rt/memory.hpp"

namespace rtpm::test {
namespace {

class AllocGuard : public testing::Test {
 protected:
  void SetUp() override {
    if (!is_alloc_guard_active()) GTEST_SKIP() << kAllocGuardInactive;
  }
};
using AllocGuardDeathTest = AllocGuard;

/// Hides a pointer from the optimiser, which may otherwise drop a pair of malloc and free.
template <class T>
T* keep(T* pointer) {
  asm volatile("" : "+r"(pointer) : : "memory");
  return pointer;
}

/// The breaches that `action` causes inside a scope of this thread.
template <class Action>
std::uint64_t breaches_of(Action action) {
  const CountBreachesOnly count_only;
  const std::uint64_t before = allocation_breach_count();
  {
    const rt::NoAllocationScope scope;
    action();
  }
  return allocation_breach_count() - before;
}

TEST_F(AllocGuard, SeesEveryWayToTakeAndGiveBackMemory) {
  EXPECT_EQ(breaches_of([] { std::free(keep(std::malloc(8))); }), 2u);
  EXPECT_EQ(breaches_of([] { std::free(keep(std::calloc(2, 8))); }), 2u);
  EXPECT_EQ(breaches_of([] { std::free(keep(std::realloc(nullptr, 8))); }), 2u);
  EXPECT_EQ(breaches_of([] { std::free(keep(std::aligned_alloc(64, 64))); }), 2u);
  EXPECT_EQ(breaches_of([] {
              void* block = nullptr;
              if (posix_memalign(&block, 64, 64) == 0) std::free(keep(block));
            }),
            2u);
  EXPECT_EQ(breaches_of([] { delete keep(new int(3)); }), 2u);
  EXPECT_EQ(breaches_of([] { delete[] keep(new double[100]); }), 2u);
  struct alignas(64) Wide {
    char bytes[64];
  };
  EXPECT_EQ(breaches_of([] { delete keep(new Wide{}); }), 2u);
}

TEST_F(AllocGuard, SeesAllocationInsideTheLibrary) {
  EXPECT_GT(breaches_of([] {
              std::vector<std::string> words(10, std::string(100, 'x'));
              keep(words.data());
            }),
            10u);
}

TEST_F(AllocGuard, PassesWhereNothingIsAllocated) {
  std::vector<int> numbers(100);
  const std::uint64_t before = allocation_breach_count();
  {
    const rt::NoAllocationScope scope;
    for (int& number : numbers)
      ++number;
    std::free(nullptr);
  }
  EXPECT_EQ(allocation_breach_count(), before);
}

TEST_F(AllocGuard, ForbidsForTheThreadOfTheScopeAlone) {
  const std::uint64_t before = allocation_breach_count();
  std::thread other;
  {
    std::vector<int> numbers(100);
    other = std::thread([] { delete keep(new int(3)); });
    const rt::NoAllocationScope scope;
    other.join();
  }
  EXPECT_EQ(allocation_breach_count(), before);
}

TEST_F(AllocGuard, PermitsAnAllowedScope) {
  const std::uint64_t before = allocation_breach_count();
  const rt::NoAllocationScope scope;
  {
    const rt::AllowAllocationScope allowed;
    delete keep(new int(3));
  }
  const std::uint64_t after = allocation_breach_count();
  const rt::AllowAllocationScope for_the_test_frame;
  EXPECT_EQ(after, before);
}

TEST_F(AllocGuard, CountsTheBlocksThatAThreadTakes) {
  const std::uint64_t before = thread_allocation_count();
  delete keep(new int(1));
  std::free(keep(std::malloc(1)));
  EXPECT_EQ(thread_allocation_count() - before, 2u);
}

void allocate_on_a_forbidden_thread() {
  const rt::NoAllocationScope scope;
  std::free(keep(std::malloc(8)));
}

TEST_F(AllocGuardDeathTest, ABreachEndsTheProcessWithItsNameAndStack) {
  EXPECT_EXIT(allocate_on_a_forbidden_thread(), testing::KilledBySignal(SIGABRT),
              "rtpm: bug: malloc was called by a thread that allocates nothing any more; its "
              "stack:\n.*alloc_guard_test");
}

}  // namespace
}  // namespace rtpm::test
