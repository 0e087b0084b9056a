#include "rtpm/rt/memory.hpp"

#include <gtest/gtest.h>

#include <windows.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "notes.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/rt/public_memory.hpp"
#include "rtpm/rt/secret_memory.hpp"
#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::rt {
namespace {

constexpr std::size_t kMib = std::size_t{1} << 20;
constexpr std::size_t kPageSize = 4096;

bool is_committed(const std::byte* address) {
  MEMORY_BASIC_INFORMATION page{};
  return VirtualQuery(address, &page, sizeof page) != 0 && page.State == MEM_COMMIT;
}

std::size_t committed_size(MutableBytes bytes) {
  std::size_t size = 0;
  for (std::size_t at = 0; at < bytes.size(); at += kPageSize)
    size += is_committed(&bytes[at]) ? kPageSize : 0;
  return size;
}

TEST(LazyMemory, IsCommittedAsItIsTouched) {
  const LazyMemory memory(16 * kMib);
  const MutableBytes bytes = memory.bytes();
  ASSERT_EQ(bytes.size(), 16 * kMib);
  EXPECT_EQ(committed_size(bytes), LazyMemory::kFirstSize);
  EXPECT_EQ(bytes.back(), std::byte{0}) << "reading suffices";
  bytes[5 * kMib] = std::byte{5};
  EXPECT_EQ(bytes[5 * kMib], std::byte{5});
  EXPECT_EQ(bytes[5 * kMib + 1], std::byte{0});
  EXPECT_LE(committed_size(bytes), LazyMemory::kFirstSize + 2 * 64 * 1024);
  std::ranges::fill(bytes, std::byte{7});
  EXPECT_TRUE(std::ranges::all_of(bytes, [](std::byte each) { return each == std::byte{7}; }));
}

TEST(LazyMemory, MayBeTouchedByManyThreads) {
  const LazyMemory memory(32 * kMib);
  std::vector<std::thread> threads;
  for (std::size_t thread = 0; thread < 4; ++thread) {
    threads.emplace_back([&, thread] {
      for (std::size_t at = thread; at < memory.bytes().size(); at += kPageSize)
        memory.bytes()[at] = static_cast<std::byte>(thread + 1);
    });
  }
  for (std::thread& thread : threads)
    thread.join();
  for (std::size_t at = 0; at < memory.bytes().size(); at += kPageSize) {
    for (std::size_t thread = 0; thread < 4; ++thread)
      ASSERT_EQ(memory.bytes()[at + thread], static_cast<std::byte>(thread + 1));
  }
}

// As the contract says: the system writes to the first part, and elsewhere to pages touched before.
TEST(LazyMemory, TakesWhatTheSystemWritesIntoTouchedPages) {
  const test::TemporaryFolder folder;
  const std::string content(LazyMemory::kFirstSize, 'x');
  folder.write("content", content);
  const HANDLE file = CreateFileW(std::filesystem::path(folder.file("content")).c_str(),
                                  GENERIC_READ, 0, nullptr, OPEN_EXISTING, 0, nullptr);
  ASSERT_NE(file, INVALID_HANDLE_VALUE);
  const LazyMemory memory(kMib);
  const auto read_to = [&](MutableBytes to) {
    DWORD size = 0;
    SetFilePointer(file, 0, nullptr, FILE_BEGIN);
    return ReadFile(file, to.data(), static_cast<DWORD>(to.size()), &size, nullptr) != 0 &&
           size == to.size() && to.back() == std::byte{'x'};
  };
  EXPECT_TRUE(read_to(memory.bytes().first(LazyMemory::kFirstSize)));
  const MutableBytes behind = memory.bytes().last(LazyMemory::kFirstSize);
  prefault(behind);
  EXPECT_TRUE(read_to(behind));
  CloseHandle(file);
}

TEST(LazyMemory, IsReleasedAndMoved) {
  std::byte* begin = nullptr;
  {
    LazyMemory memory(kMib);
    begin = memory.bytes().data();
    memory.bytes().back() = std::byte{3};
    LazyMemory other(std::move(memory));
    EXPECT_TRUE(memory.bytes().empty());
    EXPECT_EQ(other.bytes().back(), std::byte{3});
    memory = std::move(other);
    EXPECT_EQ(memory.bytes().data(), begin);
  }
  EXPECT_FALSE(is_committed(begin));
  EXPECT_TRUE(LazyMemory(0).bytes().empty());
  EXPECT_TRUE(LazyMemory(SIZE_MAX / 2).bytes().empty());
}

using LazyMemoryDeathTest = testing::Test;

// The handler of first touches leaves all other faults alone.
TEST(LazyMemoryDeathTest, ReservedMemoryOfOthersStaysUntouchable) {
  const LazyMemory memory(kMib);
  auto* const other =
      static_cast<volatile char*>(VirtualAlloc(nullptr, kMib, MEM_RESERVE, PAGE_READWRITE));
  ASSERT_NE(other, nullptr);
  EXPECT_DEATH(other[0] = 1, "");
}

TEST(Prefault, KeepsTheContent) {
  const LazyMemory memory(kMib);
  memory.bytes()[5000] = std::byte{7};
  prefault(memory.bytes());
  EXPECT_EQ(committed_size(memory.bytes()), kMib);
  EXPECT_EQ(memory.bytes()[5000], std::byte{7});
  prefault({});
}

TEST(LockMemory, SaysHowMuchStaysResident) {
  ASSERT_TRUE(lock_memory(RealtimeMode::kRequire));
  EXPECT_EQ(grant_of("memory lock"), Grant::kPartly);
  EXPECT_NE(note_of("memory lock")->text.find(" MiB of "), std::string::npos);
  ASSERT_TRUE(lock_memory(RealtimeMode::kRequire)) << "once more";
  EXPECT_EQ(grant_of("memory lock"), Grant::kPartly);
}

TEST(SecretMemory, IsZeroAndReported) {
  const SecretMemory memory(2 * kPageSize);
  ASSERT_EQ(memory.bytes().size(), 2 * kPageSize);
  EXPECT_TRUE(
      std::ranges::all_of(memory.bytes(), [](std::byte each) { return each == std::byte{0}; }));
  EXPECT_TRUE(note_of("memory of keys"));
}

TEST(PublicMemory, IsPrivateHere) {
  auto memory = PublicMemory::create("test", kPageSize);
  ASSERT_TRUE(memory) << memory.error().text();
  memory->bytes()[17] = std::byte{1};
  const PublicMemory moved = std::move(*memory);
  EXPECT_EQ(moved.bytes()[17], std::byte{1});
  EXPECT_TRUE(find_public_memory("test", kPageSize).empty());
}

}  // namespace
}  // namespace rtpm::rt
