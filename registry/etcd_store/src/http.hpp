#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"

/// The part of libcurl in use: JSON by POST over plain HTTP.
namespace rtpm::etcd_store {

/// Why there is no reply.
struct HttpError {
  std::string why{};
  bool was_sent = true;     ///< The other side may have acted.
  bool is_lasting = false;  ///< A retry would fail in the same way.
};

struct HttpReply {
  long status = 0;
  std::string body{};
};

/// Maximum size of a reply, or of a line of a stream, in bytes.
inline constexpr std::size_t kReplySizeMax = std::size_t{32} * 1024 * 1024;

/// Sends requests, one at a time, over persistent connections.
/// @threads  one at a time
class HttpClient {
 public:
  /// Aborts requests once `is_stopping` is set; it must outlive this.
  explicit HttpClient(const std::atomic<bool>& is_stopping);
  HttpClient(const HttpClient&) = delete;
  HttpClient& operator=(const HttpClient&) = delete;
  ~HttpClient();
  [[nodiscard]] expected<HttpReply, HttpError> post(const std::string& url, const std::string& body,
                                                    Duration patience);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A request whose reply arrives continuously, line by line.
/// @threads  one; wake(): any
class HttpStream {
 public:
  HttpStream();
  HttpStream(const HttpStream&) = delete;
  HttpStream& operator=(const HttpStream&) = delete;
  ~HttpStream();

  /// Starts a request; ends the previous one.
  void open(const std::string& url, const std::string& body);
  /// Returns the next line; nullopt if none arrived by `until`, or after wake().
  /// @errors   the stream has ended, or a line is too long
  [[nodiscard]] expected<std::optional<std::string>, HttpError> next_line(MonotonicTime until);
  void close();
  /// Ends a waiting next_line().
  void wake() noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::etcd_store
