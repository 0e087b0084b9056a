#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "fixture.hpp"
#include "rtpm/test/os.hpp"

// Fifty browsers, ten of which never read, do not disturb a force loop.
namespace rtpm::system_test {
namespace {

constexpr int kReaderCount = 40;
constexpr int kDeafCount = 10;

class Crowds : public ConsoleSystem {
 protected:
  Crowds() { realtime_ = "prefer"; }
};

/// Reads everything that the console sends, on a thread of its own.
class Reader {
 public:
  Reader(std::uint16_t port, const std::string& target)
      : client_(std::make_unique<ConsoleClient>(port, target)) {
    for (const char* topic : {"console/state", "console/latency", "lab/arm0/sample"})
      client_->subscribe(topic);
    thread_ = std::thread([this] {
      while (!is_stopping_) {
        const auto frame = client_->web().next(std::chrono::milliseconds{200});
        if (frame && frame->opcode == 2) ++message_count_;
      }
    });
  }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  ~Reader() {
    is_stopping_ = true;
    thread_.join();
  }
  [[nodiscard]] std::uint64_t message_count() const { return message_count_; }

 private:
  std::unique_ptr<ConsoleClient> client_;
  std::atomic<bool> is_stopping_{false};
  std::atomic<std::uint64_t> message_count_{0};
  std::thread thread_{};
};

TEST_F(Crowds, FailNoCallOfAForceLoop) {
  std::vector<std::unique_ptr<ConsoleClient>> deaf;
  for (int i = 0; i < kDeafCount; ++i) {
    deaf.push_back(connect());
    for (const char* topic : {"console/state", "lab/arm0/sample"})
      deaf.back()->subscribe(topic);
  }
  std::vector<std::unique_ptr<Reader>> readers;
  for (int i = 0; i < kReaderCount; ++i)
    readers.push_back(std::make_unique<Reader>(console_->port, console_->target));
  const char* const seconds = std::getenv("RTPM_CROWD_SECONDS");
  // The deadline is generous: a machine that is busy with other tests delays calls, too.
  const auto end = test::run({path_of("rtpm-servo"), "--registry", registry_->url, "--live", "off",
                              "--deadline", "1s", "--seconds", seconds == nullptr ? "2" : seconds},
                             std::chrono::minutes{5});
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  expect_text(end->output, {"failed calls 0"});
  for (const auto& reader : readers)
    EXPECT_TRUE(test::await([&] { return reader->message_count() > 100; }));
}

}  // namespace
}  // namespace rtpm::system_test
