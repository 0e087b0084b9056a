#include "rtpm/rt/public_memory.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <string>

#include "rtpm/test/child.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

constexpr std::size_t kSizeMax = std::size_t{1} << 20;

// Includes the process id, because other tests of this program may run at the same time.
std::string own_name() {
  return "test-" + std::to_string(getpid());
}

TEST(PublicMemory, IsFoundByNameAndShared) {
  auto memory = PublicMemory::create(own_name(), 4096);
  ASSERT_TRUE(memory) << memory.error().text();
  memory->bytes()[17] = std::byte{1};
  const auto found = find_public_memory(own_name(), kSizeMax);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].process_id(), getpid());
  EXPECT_TRUE(found[0].is_alive());
  ASSERT_EQ(found[0].bytes().size(), 4096u);
  EXPECT_EQ(found[0].bytes()[17], std::byte{1});
  memory->bytes()[17] = std::byte{2};
  EXPECT_EQ(found[0].bytes()[17], std::byte{2}) << "it is the same memory";
}

TEST(PublicMemory, DisappearsWithItsOwner) {
  {
    const auto memory = PublicMemory::create(own_name(), 4096);
    ASSERT_TRUE(memory);
  }
  EXPECT_TRUE(find_public_memory(own_name(), kSizeMax).empty());
}

TEST(PublicMemory, IsNotFoundByAnotherNameOrIfTooLarge) {
  const auto memory = PublicMemory::create(own_name() + "-more", 3 * 4096);
  ASSERT_TRUE(memory);
  EXPECT_TRUE(find_public_memory(own_name(), kSizeMax).empty());
  EXPECT_TRUE(find_public_memory(own_name() + "-more", 2 * 4096).empty());
  EXPECT_EQ(find_public_memory(own_name() + "-more", 3 * 4096).size(), 1u);
}

// A file that can shrink could end its reader with a signal.
TEST(PublicMemory, IsNotFoundIfItsFileCanShrink) {
  const std::string name = "rtpm-" + own_name();
  const int file = memfd_create(name.c_str(), MFD_CLOEXEC | MFD_ALLOW_SEALING);
  ASSERT_GE(file, 0);
  ASSERT_EQ(ftruncate(file, 4096), 0);
  EXPECT_TRUE(find_public_memory(own_name(), kSizeMax).empty());
  ASSERT_EQ(fcntl(file, F_ADD_SEALS, F_SEAL_SHRINK), 0);
  EXPECT_EQ(find_public_memory(own_name(), kSizeMax).size(), 1u) << "the seal is what was missing";
  close(file);
}

TEST(PublicMemory, RefusesWritesByOtherProcesses) {
  const auto memory = PublicMemory::create(own_name(), 4096);
  ASSERT_TRUE(memory);
  const std::string folder = "/proc/self/fd/";
  int tried_count = 0;
  for (int number = 3; number < 64; ++number) {
    if (fcntl(number, F_GET_SEALS) < 0) continue;
    const int file = open((folder + std::to_string(number)).c_str(), O_RDWR | O_CLOEXEC);
    if (file < 0) continue;
    ++tried_count;
    EXPECT_EQ(mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0), MAP_FAILED);
    EXPECT_LT(write(file, "x", 1), 0);
    EXPECT_NE(ftruncate(file, 0), 0);
    close(file);
  }
  EXPECT_EQ(tried_count, 1);
}

// A forked child shows its parent's memory once, not twice.
TEST(PublicMemory, IsFoundOnceInAForkedProcess) {
  const auto memory = PublicMemory::create(own_name(), 4096);
  ASSERT_TRUE(memory);
  const std::string name = own_name();
  const auto child = rtpm::test::run_in_child(
      [&] { return std::to_string(find_public_memory(name, kSizeMax).size()); });
  EXPECT_EQ(child.said, "1");
}

TEST(PublicMemory, IsReadableWhileItsProcessIsStoppedAndAfterItIsKilled) {
  const std::string name = own_name() + "-child";
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto memory = PublicMemory::create(name, 4096);
    if (!memory) _exit(1);
    memory->bytes()[0] = std::byte{9};
    raise(SIGSTOP);
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, WUNTRACED), child);
  ASSERT_TRUE(WIFSTOPPED(status));
  const auto found = find_public_memory(name, kSizeMax);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].process_id(), child);
  EXPECT_EQ(found[0].bytes()[0], std::byte{9});
  EXPECT_TRUE(found[0].is_alive());
  kill(child, SIGKILL);
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_FALSE(found[0].is_alive());
  EXPECT_EQ(found[0].bytes()[0], std::byte{9}) << "the mapping stays readable";
  EXPECT_TRUE(find_public_memory(name, kSizeMax).empty());
}

}  // namespace
}  // namespace rtpm::rt
