#include "rtpm/rt/memory.hpp"

#include <gtest/gtest.h>

#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <string>
#include <vector>

#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/rt/report.hpp"
#include "rtpm/rt/secret_memory.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

/// The value of `wanted` in the system's account of the process's memory.
std::size_t status_kib(const std::string& wanted) {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    if (word != wanted) continue;
    std::size_t kib = 0;
    status >> kib;
    return kib;
  }
  return 0;
}

std::size_t locked_kib() {
  return status_kib("VmLck:");
}

constexpr rlim_t kTooLittle = 64 * 1024;

TEST(LockMemory, LocksPresentAndFutureMemory) {
  if (test::kHasSanitizer) GTEST_SKIP() << test::kSanitizersLockNothing;
  const test::ChildResult child = test::run_in_child([]() -> std::string {
    const auto locked = lock_memory(RealtimeMode::kRequire);
    if (!locked) return "refused: " + locked.error().text();
    const std::size_t before = locked_kib();
    // Some of the block may come from heap memory that is already locked.
    std::vector<std::byte> block(8 << 20);
    // Without a reader, a compiler may remove the block.
    prefault(block);
    return before > 100 && locked_kib() >= before + (4 << 10) ? "" : "not locked";
  });
  if (child.said.starts_with("refused")) {
    GTEST_SKIP() << "no right to lock memory here: run as root, or raise RLIMIT_MEMLOCK";
  }
  EXPECT_EQ(child.said, "");
  EXPECT_EQ(child.status, 0);
}

TEST(LockMemory, FailsWithTheRemedyWhenRequired) {
  if (test::kHasSanitizer) GTEST_SKIP() << test::kSanitizersLockNothing;
  const test::ChildResult child = test::run_in_child([]() -> std::string {
    test::drop_realtime_rights(kTooLittle);
    const auto locked = lock_memory(RealtimeMode::kRequire);
    return locked ? "locked" : locked.error().text();
  });
  for (const char* part :
       {"can't be locked", "64 KiB", "Remedy", "RLIMIT_MEMLOCK", "ulimit -l", "--realtime off"}) {
    EXPECT_NE(child.said.find(part), std::string::npos) << part << " in: " << child.said;
  }
  EXPECT_EQ(child.errors, "");
}

// A limit just above the present size would make all later allocations fail.
TEST(LockMemory, IsRefusedWhereMemoryCouldNotGrow) {
  if (test::kHasSanitizer) GTEST_SKIP() << test::kSanitizersLockNothing;
  const test::ChildResult child = test::run_in_child([]() -> std::string {
    constexpr rlim_t kSome = 256 << 10;
    const rlim_t limit = status_kib("VmSize:") * 1024 + kSome;
    test::drop_realtime_rights(limit);
    rlimit now{};
    getrlimit(RLIMIT_MEMLOCK, &now);
    if (now.rlim_cur != limit) return "no right";
    if (!lock_memory(RealtimeMode::kPrefer)) return "an error";
    if (lock_memory(RealtimeMode::kRequire)) return "locked";
    std::vector<std::byte> block(8 << 20);
    prefault(block);
    return "";
  });
  if (child.said == "no right") {
    GTEST_SKIP() << "no right to raise the limit of locked memory: CAP_SYS_RESOURCE";
  }
  EXPECT_EQ(child.said, "");
  EXPECT_EQ(child.status, 0) << child.errors;
  EXPECT_NE(child.errors.find("there would be no room to grow"), std::string::npos) << child.errors;
}

TEST(LockMemory, WarnsOnceWhenPreferred) {
  if (test::kHasSanitizer) GTEST_SKIP() << test::kSanitizersLockNothing;
  const test::ChildResult child = test::run_in_child([]() -> std::string {
    test::drop_realtime_rights(kTooLittle);
    for (int i = 0; i < 3; ++i) {
      if (!lock_memory(RealtimeMode::kPrefer)) return "an error";
    }
    return "";
  });
  EXPECT_EQ(child.said, "");
  const auto first = child.errors.find("warning: memory can't be locked");
  EXPECT_NE(first, std::string::npos) << child.errors;
  EXPECT_EQ(child.errors.find("warning", first + 1), std::string::npos) << child.errors;
}

TEST(LockMemory, DoesNotAskWhenOff) {
  const test::ChildResult child = test::run_in_child([]() -> std::string {
    test::drop_realtime_rights(kTooLittle);
    if (!lock_memory(RealtimeMode::kOff)) return "an error";
    return locked_kib() == 0 ? "" : "locked";
  });
  EXPECT_EQ(child.said, "");
  EXPECT_EQ(child.errors, "");
}

TEST(Prefault, MakesPagesResidentAndKeepsTheirContent) {
  constexpr std::size_t kSize = std::size_t{64} * 4096;
  LazyMemory memory(kSize);
  ASSERT_EQ(memory.bytes().size(), kSize);
  memory.bytes()[5000] = std::byte{7};
  prefault(memory.bytes());
  std::array<unsigned char, 64> residents{};
  ASSERT_EQ(mincore(memory.bytes().data(), kSize, residents.data()), 0);
  for (const unsigned char resident : residents)
    EXPECT_EQ(resident & 1, 1);
  EXPECT_EQ(memory.bytes()[5000], std::byte{7});
  prefault({});
}

TEST(SecretMemory, IsZeroInAChildProcess) {
  const SecretMemory memory(8192);
  ASSERT_EQ(memory.bytes().size(), 8192u);
  memory.bytes().front() = memory.bytes().back() = std::byte{7};
  const auto child = test::run_in_child([&] {
    const bool is_zero =
        memory.bytes().front() == std::byte{0} && memory.bytes().back() == std::byte{0};
    return std::string(is_zero ? "zeros" : "secrets");
  });
  EXPECT_EQ(child.said, "zeros");
  EXPECT_EQ(memory.bytes().front(), std::byte{7});
  const auto notes = setup_report();
  EXPECT_EQ(std::ranges::count(notes, "memory of keys", &SetupNote::subject), 1);
}

// A refused lock is reported, and the memory is usable all the same.
TEST(SecretMemory, ReportsThatItIsNotLocked) {
  const auto child = test::run_in_child([] {
    const rlimit none{0, 0};
    setrlimit(RLIMIT_MEMLOCK, &none);
    // The limit does not apply to the superuser.
    if (geteuid() == 0 && setresuid(65533, 65533, 65533) != 0) return std::string("skip");
    const SecretMemory memory(4096);
    const auto notes = setup_report();
    const auto note = std::ranges::find(notes, "memory of keys", &SetupNote::subject);
    const bool is_reported = note != notes.end() && note->grant == Grant::kRefused;
    return std::string(memory.bytes().size() == 4096 && is_reported ? "said" : "silent");
  });
  if (child.said == "skip") GTEST_SKIP() << "the user can't be changed";
  EXPECT_EQ(child.said, "said");
}

}  // namespace
}  // namespace rtpm::rt
