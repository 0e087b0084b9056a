#include "rtpm/transport/shared_memory.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/test/child.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "rtpm/wire/limits.hpp"
#include "shared_memory_ends.hpp"

namespace rtpm::transport {
namespace {

using namespace test;
using namespace std::chrono_literals;
namespace fs = std::filesystem;

// ---- setting up ---------------------------------------------------------------------------------

TEST(SharedMemory, CarriesFramesInBothDirections) {
  Host host;
  Pair pair(host, 12'345);
  EXPECT_EQ(pair.given_priority, Priority{12'345});
  expect_error(*pair.client, IoError::kNothing);
  expect_error(*pair.connection, IoError::kNothing);
  std::mt19937_64 random(1);
  for (std::uint32_t i = 0; i < 500; ++i) {
    const Bytes call = frame_of(random() % (wire::kSharedPayloadSizeMax + 1), 0, i);
    const Bytes reply = frame_of(random() % (wire::kSharedPayloadSizeMax + 1), 0, i + 1);
    ASSERT_TRUE(pair.client->send(call));
    EXPECT_TRUE(pair.connection->has_buffered());
    expect_frame(*pair.connection, call);
    ASSERT_TRUE(pair.connection->send(reply, rt::now()));
    expect_frame(*pair.client, reply);
  }
}

TEST(SharedMemory, RefusesToSendAFrameThatIsTooLarge) {
  Host host;
  Pair pair(host);
  const auto sent = pair.client->send(frame_of(wire::kSharedPayloadSizeMax + 1));
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error(), IoError::kFailed);
  expect_error(*pair.connection, IoError::kNothing);
}

// hp-16.1-1: the exact bytes.
TEST(SharedMemory, AnswersAsTheSpecificationSays) {
  Host host;
  Descriptor socket = connect_to_name(abstract_name(host.address));
  ASSERT_TRUE(socket.is_open());
  write_all(socket, request_of(24'000));
  const auto client = host.welcome();
  ASSERT_TRUE(client);
  EXPECT_EQ(client->priority, Priority{24'000});
  const RawMessage answer = take_message(socket.number());
  Bytes wanted(kAnswerSize);
  std::memcpy(wanted.data(), "HPSM\1\0\0\0\0\0\2\0\0\0\2", 15);
  EXPECT_EQ(answer.bytes, wanted);
  struct stat status {};
  ASSERT_EQ(fstat(answer.descriptor.number(), &status), 0);
  EXPECT_EQ(status.st_size, 12'288 + 2 * 128 * 1024);
}

TEST(SharedMemory, AnswersAProbeWithoutMemory) {
  Host host;
  Descriptor socket = connect_to_name(abstract_name(host.address));
  write_all(socket, request_of(0, 1, 1));
  EXPECT_FALSE(host.welcome());
  const RawMessage answer = take_message(socket.number());
  ASSERT_EQ(answer.bytes.size(), kAnswerSize);
  EXPECT_EQ(load_le<std::uint16_t>(answer.bytes.data() + 6), 0);
  EXPECT_FALSE(answer.descriptor.is_open());
  EXPECT_TRUE(take_message(socket.number()).bytes.empty()) << "the server closes";
}

TEST(SharedMemory, IsServedIfAServerAnswers) {
  const SharedMemoryAddress address = own_address();
  EXPECT_FALSE(is_shared_memory_served(address, soon()));
  Host host(address);
  std::thread server([&] { EXPECT_FALSE(host.welcome()) << "it only asks"; });
  EXPECT_TRUE(is_shared_memory_served(address, soon()));
  server.join();
  EXPECT_FALSE(is_shared_memory_served(address, rt::now() + 5ms)) << "nobody answers";
}

// hp-16.1-2
TEST(SharedMemory, ClosesOnAnInvalidRequest) {
  Host host;
  std::vector<Bytes> requests{Bytes(1), Bytes(kRequestSize), request_of(0x8000),
                              request_of(0, 1, 2)};
  Bytes cut = request_of(0);
  cut.pop_back();
  requests.push_back(cut);
  Bytes longer = request_of(0);
  longer.push_back({});
  requests.push_back(longer);
  Bytes reserved = request_of(0);
  reserved[15] = std::byte{1};
  requests.push_back(reserved);
  for (const Bytes& request : requests) {
    Descriptor socket = connect_to_name(abstract_name(host.address));
    write_all(socket, request);
    EXPECT_FALSE(host.welcome());
    EXPECT_TRUE(take_message(socket.number()).bytes.empty()) << "not worth an answer";
  }
}

// hp-16.1-3
TEST(SharedMemory, ReportsItsVersionToAnotherVersion) {
  Host host;
  Descriptor socket = connect_to_name(abstract_name(host.address));
  Bytes request = request_of(0xffff, 2);
  request.resize(40, std::byte{0xee});
  write_all(socket, request);
  EXPECT_FALSE(host.welcome());
  const RawMessage answer = take_message(socket.number());
  ASSERT_EQ(answer.bytes.size(), kAnswerSize);
  EXPECT_EQ(load_le<std::uint16_t>(answer.bytes.data() + 4), 1);
  EXPECT_EQ(load_le<std::uint16_t>(answer.bytes.data() + 6), 2);
}

// hp-16.1-4
TEST(SharedMemory, RefusesOtherUsers) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can be another user";
  Host host;
  std::optional<SharedMemoryClient> given;
  std::thread server([&] { given = host.welcome(); });
  const auto child = rtpm::test::run_in_child([&] {
    rtpm::test::drop_realtime_rights();
    // The client trusts the superuser's server; the server refuses.
    const auto client = open_shared_memory_transport(host.address, 0, soon());
    return client ? std::string("it was taken") : client.error().text();
  });
  server.join();
  EXPECT_FALSE(given);
  expect_text(child.said, {"the server refused", "Remedy: run both as one user"});
}

// hp-16.1-4: any user may take a name.
TEST(SharedMemory, TrustsNoServerOfAnotherUser) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can be another user";
  const SharedMemoryAddress address = own_address();
  std::array<int, 2> ready_pipe{};
  ASSERT_EQ(pipe(ready_pipe.data()), 0);
  const pid_t child = fork();
  if (child == 0) {
    rtpm::test::drop_realtime_rights();
    const auto listener = SharedMemoryListener::open(address);
    const char word = listener ? '+' : '-';
    if (write(ready_pipe[1], &word, 1) != 1) _exit(1);
    while (true)
      pause();
  }
  char word = 0;
  EXPECT_EQ(read(ready_pipe[0], &word, 1), 1);
  EXPECT_EQ(word, '+');
  EXPECT_FALSE(is_shared_memory_served(address, soon()));
  const auto client = open_shared_memory_transport(address, 0, soon());
  ASSERT_FALSE(client);
  expect_text(client.error().text(), {"another user's"});
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  close(ready_pipe[0]);
  close(ready_pipe[1]);
}

// hp-16.1-5
TEST(SharedMemory, CannotBeResizedByThePeer) {
  Host host;
  const RawPair pair(host);
  EXPECT_NE(ftruncate(pair.memory->descriptor(), 0), 0);
  EXPECT_NE(ftruncate(pair.memory->descriptor(), 1 << 30), 0);
}

/// Answers the next client with the given sizes and memory, as a bad server would.
void answer_badly(const SharedMemoryListener& listener, std::uint32_t ring_size, int memory) {
  ASSERT_TRUE(wait_readable(listener.descriptor(), soon()));
  const Descriptor socket(accept4(listener.descriptor(), nullptr, nullptr, SOCK_CLOEXEC));
  ASSERT_EQ(take_message(socket.number()).bytes.size(), kRequestSize);
  Bytes answer(kAnswerSize);
  std::memcpy(answer.data(), "HPSM\1", 5);
  store_le(answer.data() + 8, ring_size);
  store_le(answer.data() + 12, ring_size);
  iovec part{answer.data(), answer.size()};
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof memory)> control{};
  msghdr header{};
  header.msg_iov = &part;
  header.msg_iovlen = 1;
  if (memory >= 0) {
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    cmsghdr* const rights = CMSG_FIRSTHDR(&header);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(sizeof memory);
    std::memcpy(CMSG_DATA(rights), &memory, sizeof memory);
  }
  ASSERT_EQ(sendmsg(socket.number(), &header, 0), static_cast<ssize_t>(answer.size()));
}

// hp-16.1-5
TEST(SharedMemory, IsRefusedIfAnAccessCouldFail) {
  Host host;
  const Descriptor unsealed(memfd_create("unsealed", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  ASSERT_EQ(ftruncate(unsealed.number(), 1 << 20), 0);
  const Descriptor sealed(memfd_create("sealed", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  ASSERT_EQ(ftruncate(sealed.number(), 1 << 16), 0);
  ASSERT_EQ(fcntl(sealed.number(), F_ADD_SEALS, F_SEAL_SHRINK), 0);
  const Descriptor without_event(memfd_create("sealed", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  ASSERT_EQ(ftruncate(without_event.number(), 1 << 20), 0);
  ASSERT_EQ(fcntl(without_event.number(), F_ADD_SEALS, F_SEAL_SHRINK), 0);
  struct Answer {
    std::uint32_t ring_size;
    int memory;
  };
  for (const Answer& answer :
       {Answer{128 * 1024, unsealed.number()}, Answer{128 * 1024, sealed.number()},
        Answer{0, sealed.number()}, Answer{48 * 1024, sealed.number()},
        Answer{1u << 31, sealed.number()}, Answer{128 * 1024, -1},
        Answer{128 * 1024, without_event.number()}}) {
    std::thread server([&] { answer_badly(host.listener, answer.ring_size, answer.memory); });
    const auto client = open_shared_memory_transport(host.address, 0, soon());
    server.join();
    ASSERT_FALSE(client) << answer.ring_size;
    expect_text(client.error().text(), {"breaks the rules"});
  }
}

TEST(SharedMemory, ReportsAServerWithoutAFreeDescriptor) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    const SharedMemoryAddress address = own_address();
    auto listener = SharedMemoryListener::open(address);
    if (!listener) return listener.error().text();
    std::string text;
    std::thread client([&] {
      const auto opened = open_shared_memory_transport(address, 0, soon());
      text = opened ? "there was memory" : opened.error().text();
    });
    static_cast<void>(wait_readable(listener->descriptor(), soon()));
    Accepted accepted = listener->accept();
    static_cast<void>(wait_readable(accepted.socket.number(), soon()));
    const rlimit few{64, 64};
    setrlimit(RLIMIT_NOFILE, &few);
    while (dup(STDERR_FILENO) >= 0) {
    }
    const int shortage = welcome_shared_memory_client(std::move(accepted.socket)).shortage;
    client.join();
    return shortage == EMFILE ? text : "no shortage: " + text;
  });
  expect_text(child.said, {"the server has no memory or no descriptor left", "ulimit -n"});
  EXPECT_EQ(child.status, 0) << child.errors;
}

TEST(SharedMemory, ReportsWhyItCannotBeOpened) {
  const SharedMemoryAddress address = own_address();
  const auto nobody = open_shared_memory_transport(address, 0, soon());
  ASSERT_FALSE(nobody);
  expect_text(nobody.error().text(), {"@rtpm/test-", "refused", "start the server"});
  const Host host(address);
  const auto silent = open_shared_memory_transport(address, 0, rt::now() + 5ms);
  ASSERT_FALSE(silent);
  expect_text(silent.error().text(), {"does not answer"});
  const auto second = SharedMemoryListener::open(address);
  ASSERT_FALSE(second);
  expect_text(second.error().text(), {"already in use", "ss -xlp"});
  const auto nowhere = SharedMemoryListener::open(own_address("/nowhere/at/all"));
  ASSERT_FALSE(nowhere);
  expect_text(nowhere.error().text(), {"/nowhere/at/all/", "give a folder"});
  const auto too_long = SharedMemoryListener::open(own_address("/" + std::string(120, 'x')));
  ASSERT_FALSE(too_long);
  expect_text(too_long.error().text(), {"longer than 107 bytes"});
}

// ---- the end ------------------------------------------------------------------------------------

// hp-16.4-1
TEST(SharedMemory, ReportsTheEndAfterTheLastFrame) {
  for (const bool is_waiting : {false, true}) {
    Host host;
    Pair pair(host);
    ASSERT_TRUE(pair.connection->send(frame_of(1), rt::now()));
    ASSERT_TRUE(pair.connection->send(frame_of(2), rt::now()));
    pair.connection.reset();
    if (is_waiting) pair.client->wait(soon());
    expect_frame(*pair.client, frame_of(1));
    expect_frame(*pair.client, frame_of(2));
    // A reader that spins checks now and then.
    EXPECT_TRUE(await(
        [&] {
          if (is_waiting) pair.client->wait(soon());
          const auto end = pair.client->receive();
          return !end && end.error() == IoError::kClosed;
        },
        20s));
  }
}

TEST(SharedMemory, ReportsADisconnectedClient) {
  Host host;
  Pair pair(host);
  ASSERT_TRUE(pair.client->send(frame_of(1)));
  pair.client.reset();
  EXPECT_TRUE(wait_readable(pair.connection->descriptor(), soon()));
  pair.connection->on_ready();
  expect_frame(*pair.connection, frame_of(1));
  expect_error(*pair.connection, IoError::kClosed);
}

/// The number of this process's descriptors for shared memory or sockets.
std::size_t count_of_descriptors() {
  std::size_t count = 0;
  for (const auto& entry : fs::directory_iterator("/proc/self/fd")) {
    static_cast<void>(entry);
    ++count;
  }
  return count;
}
std::size_t count_of_mappings() {
  std::ifstream file("/proc/self/maps");
  std::size_t count = 0;
  for (std::string line; std::getline(file, line);) {
    if (line.find("memfd:rtpm") != line.npos) ++count;
  }
  return count;
}
bool is_name_there(const std::string& name) {
  std::ifstream file("/proc/net/unix");
  for (std::string line; std::getline(file, line);) {
    if (line.ends_with("@" + name)) return true;
  }
  return false;
}

TEST(SharedMemory, ReleasesDescriptorsMappingsAndName) {
  const SharedMemoryAddress address = own_address();
  const std::size_t descriptor_count = count_of_descriptors();
  EXPECT_EQ(count_of_mappings(), 0u);
  {
    Host host(address);
    Pair pair(host);
    EXPECT_EQ(count_of_mappings(), 2u);
    EXPECT_TRUE(is_name_there(abstract_name(address)));
  }
  EXPECT_EQ(count_of_mappings(), 0u);
  EXPECT_EQ(count_of_descriptors(), descriptor_count);
  EXPECT_FALSE(is_name_there(abstract_name(address)));
}

// hp-16.4-1: this holds for any kind of end.
TEST(SharedMemory, EndsWithAKilledServer) {
  for (const bool is_waiting : {false, true}) {
    const SharedMemoryAddress address = own_address();
    std::array<int, 2> ready_pipe{};
    ASSERT_EQ(pipe(ready_pipe.data()), 0);
    const pid_t server = fork();
    if (server == 0) {
      Host host(address);
      if (write(ready_pipe[1], "+", 1) != 1) _exit(1);
      const auto client = host.welcome();
      while (true)
        pause();
    }
    char word = 0;
    ASSERT_EQ(read(ready_pipe[0], &word, 1), 1);
    const auto client = open_shared_memory_transport(address, 0, soon());
    ASSERT_TRUE(client) << client.error().text();
    kill(server, SIGKILL);
    EXPECT_TRUE(await([&] {
      if (is_waiting) (*client)->wait(soon());
      const auto end = (*client)->receive();
      return !end && end.error() == IoError::kClosed;
    }));
    waitpid(server, nullptr, 0);
    EXPECT_FALSE(is_name_there(abstract_name(address)));
    EXPECT_FALSE(is_shared_memory_served(address, soon()));
    close(ready_pipe[0]);
    close(ready_pipe[1]);
  }
}

TEST(SharedMemory, EndsWithAKilledClient) {
  const std::size_t descriptor_count = count_of_descriptors();
  {
    Host host;
    const pid_t client = fork();
    if (client == 0) {
      const auto opened = open_shared_memory_transport(host.address, 0, soon());
      if (!opened || !(*opened)->send(frame_of(48))) _exit(1);
      while (true)
        pause();
    }
    const auto given = host.welcome();
    ASSERT_TRUE(given);
    EXPECT_TRUE(await([&] { return given->connection->has_buffered(); }));
    kill(client, SIGKILL);
    waitpid(client, nullptr, 0);
    EXPECT_TRUE(wait_readable(given->connection->descriptor(), soon()));
    given->connection->on_ready();
    expect_frame(*given->connection, frame_of(48));
    expect_error(*given->connection, IoError::kClosed);
  }
  EXPECT_EQ(count_of_mappings(), 0u);
  EXPECT_EQ(count_of_descriptors(), descriptor_count);
}

// ---- files --------------------------------------------------------------------------------------

class SharedMemoryFile : public testing::Test {
 protected:
  rtpm::test::TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
};

TEST_F(SharedMemoryFile, ReachesAServerInAFolder) {
  {
    Host host(own_address(folder_.string()));
    EXPECT_TRUE(fs::is_socket(folder_ / (host.address.host + ":4711")));
    Pair pair(host);
    ASSERT_TRUE(pair.client->send(frame_of(48)));
    expect_frame(*pair.connection, frame_of(48));
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(SharedMemoryFile, ReplacesTheFileOfAKilledServerOnly) {
  const SharedMemoryAddress address = own_address(folder_.string());
  const pid_t killed = fork();
  if (killed == 0) {
    const Host host(address);
    kill(getpid(), SIGKILL);
  }
  waitpid(killed, nullptr, 0);
  EXPECT_FALSE(fs::is_empty(folder_)) << "or this shows nothing";
  const Host host(address);
  const auto second = SharedMemoryListener::open(address);
  ASSERT_FALSE(second);
  expect_text(second.error().text(), {"already in use"});
  EXPECT_FALSE(fs::is_empty(folder_));
}

}  // namespace
}  // namespace rtpm::transport
