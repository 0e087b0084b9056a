#include "figures/shared_core.hpp"

#include <gtest/gtest.h>
#include <sched.h>

#include <array>

#include "rtpm/test/os.hpp"

namespace rtpm::bench {
namespace {

// A neighbour may be there for long, but not take turns with the test.
TEST(SharedCore, LooksAlikeWhereverItFindsTheSame) {
  const std::array<int, 1> cpus{sched_getcpu()};
  EXPECT_TRUE(rtpm::test::await([&] {
    const double one = SharedCore::look(cpus);
    const double other = SharedCore::look(cpus);
    return one > 0.1 && one < 1.1 * other && other < 1.1 * one;
  }));
}

TEST(SharedCore, IsAloneWhereNothingLooksQuieter) {
  const std::array<int, 1> cpus{sched_getcpu()};
  const double alone = SharedCore::alone(cpus);
  EXPECT_GT(alone, 0);
  EXPECT_GE(SharedCore::look(cpus), SharedCore::alone(cpus)) << "a quieter look is the new measure";
  EXPECT_LE(SharedCore::alone(cpus), alone);
  EXPECT_FALSE(SharedCore::is_shared(0.57, 0.55)) << "as it varies by itself";
  EXPECT_TRUE(SharedCore::is_shared(0.72, 0.55)) << "the least that a neighbour was seen to take";
}

TEST(SharedCore, LeavesItsThreadWhereItWas) {
  cpu_set_t before;
  ASSERT_EQ(sched_getaffinity(0, sizeof before, &before), 0);
  const std::array<int, 1> cpus{sched_getcpu()};
  static_cast<void>(SharedCore::look(cpus));
  cpu_set_t after;
  ASSERT_EQ(sched_getaffinity(0, sizeof after, &after), 0);
  EXPECT_TRUE(CPU_EQUAL(&before, &after));
}

TEST(SharedCore, SeesNobodyOnCpusThatAreNotThere) {
  const std::array<int, 1> cpus{CPU_SETSIZE - 1};
  EXPECT_EQ(SharedCore::look(cpus), 0);
  EXPECT_FALSE(SharedCore::is_shared(cpus));
}

}  // namespace
}  // namespace rtpm::bench
