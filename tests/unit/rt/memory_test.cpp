#include "rtpm/rt/memory.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace rtpm::rt {
namespace {

TEST(NoAllocationScope, HoldsUntilTheOutermostEnds) {
  EXPECT_FALSE(is_allocation_forbidden());
  {
    const NoAllocationScope outer;
    EXPECT_TRUE(is_allocation_forbidden());
    {
      const NoAllocationScope inner;
      EXPECT_TRUE(is_allocation_forbidden());
    }
    EXPECT_TRUE(is_allocation_forbidden());
  }
  EXPECT_FALSE(is_allocation_forbidden());
}

TEST(NoAllocationScope, AppliesToItsThreadOnly) {
  const NoAllocationScope scope;
  bool is_forbidden_there = true;
  std::thread([&] { is_forbidden_there = is_allocation_forbidden(); }).join();
  EXPECT_FALSE(is_forbidden_there);
}

TEST(AllowAllocationScope, LiftsAllScopesAndRestoresThem) {
  const NoAllocationScope outer;
  const NoAllocationScope inner;
  {
    const AllowAllocationScope allowed;
    EXPECT_FALSE(is_allocation_forbidden());
    {
      const NoAllocationScope forbidden_again;
      EXPECT_TRUE(is_allocation_forbidden());
    }
    EXPECT_FALSE(is_allocation_forbidden());
  }
  EXPECT_TRUE(is_allocation_forbidden());
}

}  // namespace
}  // namespace rtpm::rt
