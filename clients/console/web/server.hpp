#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "downloads/download.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "web/connection.hpp"
#include "web/gateway.hpp"

namespace rtpm::console {

/// Concurrent connections: HTTP requests, clients without the token, clients with it. In the first
/// two groups a new one displaces the oldest; the third is reserved, and its clients are never
/// displaced.
inline constexpr std::size_t kRequestCountMax = 128;
inline constexpr std::size_t kObserverCountMax = 64;
inline constexpr std::size_t kOperatorCountMax = 64;
/// Concurrent downloads; more are refused.
inline constexpr std::size_t kDownloadCountMax = 8;
/// Concurrent connections of pages to servers of the registry; more are refused.
inline constexpr std::size_t kGatewayCountMax = 64;
/// The most bytes of such a connection that wait in the console, from the page and to it.
inline constexpr std::size_t kGatewayMessageSizeMax = std::size_t{256} << 10;
inline constexpr std::size_t kGatewayBlockSize = std::size_t{64} << 10;
/// The largest frame of a client in bytes, with the token and without.
inline constexpr std::size_t kFrameSizeMax = std::size_t{1} << 20;
inline constexpr std::size_t kObserverFrameSizeMax = std::size_t{64} << 10;

struct WebConfig {
  std::string address = "127.0.0.1";
  std::uint16_t port = 8765;  ///< 0 for any free port.
  std::filesystem::path page_folder{};
  std::string token{};
  bool is_read_only = false;
  std::vector<std::string> host_names{};  ///< Names by which browsers may reach this server.
};

/// Serves the page over HTTP and clients over WebSocket, on one port and one thread.
/// @ownership refers to its handler, the source of downloads and the targets of the gateway, which
///            must outlive it
/// @threads  run(): one; post() and stop(): any; every(): before run() or on its thread
class WebServer {
 public:
  /// @errors   the address can't be served
  [[nodiscard]] static expected<std::unique_ptr<WebServer>, SetupError> create(
      WebConfig config, ConnectionHandler& handler, DownloadSource& downloads,
      const GatewayTargets& targets);
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;
  ~WebServer();

  /// The address for a browser on this host: "http://127.0.0.1:8765/".
  [[nodiscard]] std::string url() const;
  [[nodiscard]] std::uint16_t port() const noexcept;

  /// Serves until stop(), then closes all connections.
  void run();
  /// Runs `work` soon on the thread of run(); never after run() has ended.
  void post(std::function<void()> work);
  /// Runs `work` periodically on the thread of run().
  void every(Duration period, std::function<void()> work);
  /// Ends run().
  void stop();

  struct Impl;

 private:
  explicit WebServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::console
