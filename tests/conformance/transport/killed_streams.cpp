#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <optional>
#include <string>
#include <thread>

#include "deferred_suite.hpp"

// Streams of servers in processes of their own, which end.
namespace rtpm::rpc::test {
namespace {

using namespace std::chrono_literals;

/// A server in a process of its own, whose only method streams items without end.
class StreamingProcess {
 public:
  explicit StreamingProcess(std::size_t item_size) {
    std::array<int, 2> ends{};
    if (pipe(ends.data()) != 0) return;
    child_ = fork();
    if (child_ == 0) {
      serve(ends[1], item_size);
      _exit(0);
    }
    close(ends[1]);
    const ssize_t size = read(ends[0], &port_, sizeof port_);
    EXPECT_EQ(size, static_cast<ssize_t>(sizeof port_));
    close(ends[0]);
  }
  ~StreamingProcess() { kill_and_wait(); }
  StreamingProcess(const StreamingProcess&) = delete;
  StreamingProcess& operator=(const StreamingProcess&) = delete;
  void signal(int number) const { ::kill(child_, number); }
  /// Returns when the process has ended and its sockets are closed.
  void kill_and_wait() {
    if (child_ < 0) return;
    signal(SIGKILL);
    int status = 0;
    while (waitpid(child_, &status, 0) < 0 && errno == EINTR) {
    }
    child_ = -1;
  }
  [[nodiscard]] std::string url() const {
    return "rtpm://127.0.0.1:" + std::to_string(port_) + "/late";
  }

 private:
  static void serve(int told, std::size_t item_size) {
    DeferringServant servant;
    auto server = Server::create(quiet_config());
    if (!server || !(*server)->add("late", servant) || !(*server)->start()) _exit(1);
    const std::uint16_t port = (*server)->port();
    if (write(told, &port, sizeof port) != sizeof port) _exit(1);
    ItemWriter writer = servant.writer();
    const auto item = item_of(0, item_size);
    while (true) {
      if (!writer.write(item)) std::this_thread::sleep_for(1ms);
    }
  }

  pid_t child_ = -1;
  std::uint16_t port_ = 0;
};

class StreamsOfAnotherProcess : public TransportSuite {
 protected:
  /// Reads to the end, or until `until`; returns the reason.
  static CallError read_to_the_end(ItemReader& reader, MonotonicTime until) {
    while (true) {
      const auto item = reader.next(until);
      if (!item) return item.error();
      if (!*item) return CallError::kBadReply;
    }
  }
  void open(const StreamingProcess& process, std::uint32_t miss_count_max = kMissCountMin) {
    auto bound = Binding::bind(node_, process.url(), kDeferredInterface,
                               {.deadline = rtpm::test::kPatience});
    ASSERT_TRUE(bound) << bound.error().text();
    binding_.emplace(std::move(*bound));
    auto reader = binding_->open_stream(kCount, {}, {.miss_count_max = miss_count_max});
    ASSERT_TRUE(reader);
    reader_ = std::move(*reader);
    for (int i = 0; i < 3; ++i)
      ASSERT_TRUE(reader_.next(rt::now() + rtpm::test::kPatience));
  }
  Node node_{node_config()};
  std::optional<Binding> binding_;
  ItemReader reader_;
};

TEST_P(StreamsOfAnotherProcess, EndWithIt) {
  for (const std::size_t size : {std::size_t{100}, std::size_t{256} * 1024}) {
    StreamingProcess process(size);
    open(process);
    process.signal(SIGKILL);
    const CallError error = read_to_the_end(reader_, rt::now() + rtpm::test::kPatience);
    EXPECT_TRUE(error == CallError::kDisconnected || error == CallError::kTimeout)
        << to_string(error);
    EXPECT_FALSE(reader_.is_open());
    reader_ = {};
  }
}

// The reader acknowledges items that came before the end to a server that is gone.
TEST_P(StreamsOfAnotherProcess, EndAfterTheItemsSentBefore) {
  for (int i = 0; i < 20; ++i) {
    StreamingProcess process(100);
    open(process);
    process.kill_and_wait();
    const CallError error = read_to_the_end(reader_, rt::now() + rtpm::test::kPatience);
    EXPECT_TRUE(error == CallError::kDisconnected || error == CallError::kTimeout)
        << to_string(error);
    EXPECT_FALSE(reader_.is_open());
    reader_ = {};
  }
}

// hp-5.10-7
TEST_P(StreamsOfAnotherProcess, EndWhenItFallsSilent) {
  StreamingProcess process(std::size_t{64} * 1024);
  open(process);
  process.signal(SIGSTOP);
  EXPECT_EQ(read_to_the_end(reader_, rt::now() + rtpm::test::kPatience), CallError::kTimeout);
  EXPECT_FALSE(reader_.is_open());
}

INSTANTIATE_TEST_SUITE_P(Udp, StreamsOfAnotherProcess, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, StreamsOfAnotherProcess, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, StreamsOfAnotherProcess,
                         testing::Values(Transport::kSharedMemory));

}  // namespace
}  // namespace rtpm::rpc::test
