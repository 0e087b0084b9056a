#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <memory>
#include <new>

#include "crypto_fixture.hpp"
#include "rtpm/crypto/session.hpp"
#include "rtpm/rt/secret_memory.hpp"
#include "rtpm/test/child.hpp"
#include "sessions/peers.hpp"

// Sessions in a forked child, for systems that fork.
namespace rtpm::crypto::test {
namespace {

constexpr std::size_t kHeader = 64;

class ForkedSession : public ::testing::TestWithParam<Suite> {};
INSTANTIATE_TEST_SUITE_P(All, ForkedSession, ::testing::ValuesIn(all_suites()));

// A child process that continued to seal would repeat its parent's counters.
TEST_P(ForkedSession, SealsNothingWithWipedMemory) {
  const std::size_t size = (sizeof(SealedSession) + 4095) / 4096 * 4096;
  void* const pages =
      mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(pages, MAP_FAILED);
  if (madvise(pages, size, MADV_WIPEONFORK) != 0) {
    munmap(pages, size);
    GTEST_SKIP() << "this kernel has no MADV_WIPEONFORK";
  }
  Random random(5);
  auto* const session =
      new (pages) SealedSession(keys_of_both(GetParam(), random).client, Order::kAny);
  Bytes out(kHeader + kTrailerSize);
  const Bytes header(kHeader);
  ASSERT_TRUE(session->seal(header, {}, out));
  const pid_t child = fork();
  if (child == 0) _exit(session->seal(header, {}, out) ? 1 : 0);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  EXPECT_TRUE(session->seal(header, {}, out));
  std::destroy_at(session);
  munmap(pages, size);
}

}  // namespace
}  // namespace rtpm::crypto::test

namespace rtpm::sealed::test {
namespace {

constexpr MonotonicTime kNow = MonotonicTime{} + std::chrono::seconds{1000};

TEST(SealedSessions, AreSilentInAForkedChild) {
  const rt::SecretMemory secrets(std::size_t{256} * 1024);
  Server server;
  server.secrets = secrets.bytes();
  server.restart();
  Client client(server.identity.key.public_key);
  open_and_call(client, server, kNow);
  client.call("two", kNow);
  const Bytes call = client.sent.front();
  const auto child = rtpm::test::run_in_child([&] {
    wire::Header header;
    header.kind = FrameKind::kReply;
    header.session = client.channel.session();
    std::array<std::byte, wire::kHeaderSize> reply;
    wire::encode(header, reply.data());
    const bool is_silent = server.sealed->seal(reply).empty() && server.receive(call, kNow).empty();
    return std::string(is_silent && server.run_count == 1 ? "silent" : "speaks");
  });
  EXPECT_EQ(child.said, "silent");
  talk(client, server, kNow);
  EXPECT_EQ(client.reply, "two");
  server.sealed.reset();
}

}  // namespace
}  // namespace rtpm::sealed::test
