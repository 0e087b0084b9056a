#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <list>
#include <mutex>
#include <string>
#include <thread>

namespace rtpm::storage_test {

/// An endpoint with a test's own answers: HTTP of one request per connection.
class FakeEtcd {
 public:
  /// Returns the body that answers a request; empty to send none and keep the connection open.
  using Handler = std::function<std::string(const std::string& path, const std::string& body)>;

  explicit FakeEtcd(Handler handler);
  FakeEtcd(const FakeEtcd&) = delete;
  FakeEtcd& operator=(const FakeEtcd&) = delete;
  ~FakeEtcd();
  [[nodiscard]] std::string endpoint() const;

 private:
  void run();
  void serve(int connection);

  Handler handler_;
  int listener_ = -1;
  std::uint16_t port_ = 0;
  std::atomic<bool> is_ending_ = false;
  std::list<std::thread> threads_{};
  std::mutex mutex_;
  std::list<int> open_{};
  std::thread thread_{};
};

}  // namespace rtpm::storage_test
