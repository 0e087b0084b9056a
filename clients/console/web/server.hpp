#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "web/connection.hpp"

namespace rtpm::console {

/// Connections at a time, of all kinds.
inline constexpr std::size_t kConnectionCountMax = 64;
/// Of a client's frame, in bytes.
inline constexpr std::size_t kFrameSizeMax = std::size_t{1} << 20;

struct WebConfig {
  std::string address = "127.0.0.1";
  std::uint16_t port = 8765;  ///< 0: any.
  std::filesystem::path page_folder{};
  std::string token{};
  bool is_read_only = false;
};

/// Serves the page over HTTP and clients over WebSocket, on one port and one thread.
/// @ownership refers to its handler, which must outlive it
/// @threads  run() on one; post() and stop() on any; every() before run() or on the same
class WebServer {
 public:
  /// @errors   the address can't be served
  [[nodiscard]] static expected<std::unique_ptr<WebServer>, SetupError> create(
      WebConfig config, ConnectionHandler& handler);
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;
  ~WebServer();

  /// "http://127.0.0.1:8765/".
  [[nodiscard]] std::string url() const;

  /// Serves until stop(), then closes all connections.
  void run();
  /// Runs `work` soon on the thread of run(); never after its end.
  void post(std::function<void()> work);
  /// Runs `work` again and again on the thread of run().
  void every(Duration period, std::function<void()> work);
  /// Ends run().
  void stop();

  struct Impl;

 private:
  explicit WebServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::console
