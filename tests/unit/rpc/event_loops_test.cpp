#include <gtest/gtest.h>
#include <poll.h>

#include <functional>
#include <map>
#include <string>

#include "rtpm/rpc/completions.hpp"
#include "rtpm/test/echo_server.hpp"

// An example: the calls of a program whose own event loop waits for everything else. For Asio, see
// registry/asio.
namespace rtpm::rpc {
namespace {

using namespace test;

class EventLoops : public testing::Test {
 protected:
  /// Calls `count` times, each call after the last one's reply, then `stop()`.
  void call(int count, const std::function<void()>& stop) {
    if (count == 0) return stop();
    completions_.then(binding_.begin(echo::kEcho, bytes_of("x")), [=, this](const auto& reply) {
      if (reply) text_ += text_of(*reply);
      call(count - 1, stop);
    });
  }

  EchoServer server_;
  Node node_{quiet_node(transports_of_host().back())};
  Binding binding_ = bind_echo(node_, server_);
  Completions completions_;
  std::string text_;
};

/// A loop like QCoreApplication, in few lines of poll(2).
class PollLoop {
 public:
  void exec() {
    while (is_running_) {
      std::vector<pollfd> entries;
      for (const auto& [descriptor, on_activated] : notifiers_)
        entries.push_back({descriptor, POLLIN, 0});
      ASSERT_GT(poll(entries.data(), entries.size(), 20'000), 0);
      for (const pollfd& entry : entries) {
        if (entry.revents != 0) notifiers_[entry.fd]();
      }
    }
  }
  void quit() { is_running_ = false; }
  /// With Qt: connect(new QSocketNotifier(descriptor, QSocketNotifier::Read, this),
  /// &QSocketNotifier::activated, this, on_activated).
  void notify(int descriptor, std::function<void()> on_activated) {
    notifiers_[descriptor] = std::move(on_activated);
  }

 private:
  std::map<int, std::function<void()>> notifiers_;
  bool is_running_ = true;
};

TEST_F(EventLoops, MayBeLikeQt) {
  PollLoop application;
  application.notify(completions_.descriptor().value(), [&] { completions_.poll(); });
  call(20, [&] { application.quit(); });
  application.exec();
  EXPECT_EQ(text_, std::string(20, 'x'));
}

}  // namespace
}  // namespace rtpm::rpc
