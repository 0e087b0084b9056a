#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::capture {

/// Counters of a recorder of calls.
struct CallRecorderStatus {
  std::uint64_t call_count = 0;             ///< Recorded calls that have ended.
  std::uint64_t dropped_count = 0;          ///< Records that the server reported as dropped.
  std::uint64_t omitted_payload_count = 0;  ///< Payloads that the server omitted as too long.
  std::uint64_t unreadable_count = 0;       ///< Payloads that did not match their schema.
  std::optional<std::string> problem{};     ///< Why the recording ended.
};

/// Records the calls of one server's objects through its tap, without generated code. Requests and
/// replies go to channels "lab/arm0/read/request" and "lab/arm0/read/response", the outcome of each
/// call to "lab/arm0/calls". Payloads are FlatBuffers whose root is the method's table. A message's
/// sequence is the call's number. Its publish time, on this host's clock, is when the server
/// received the request or the method ended; its log time is the time of arrival.
///
/// The counts of losses are written into the file as metadata "rtpm.calls", whenever they increase
/// and at the end.
/// @ownership refers to its recorder and node, which must outlive it; owns its thread
/// @threads  any
class CallRecorder {
 public:
  /// Starts recording once the server has switched its tap on.
  /// @param urls  the objects' URLs, all of one server
  /// @realtime set-up only
  /// @errors   no server, no such object, an object without a published schema, a server without a
  ///           tap or whose tap is in use, an error of the file
  [[nodiscard]] static expected<std::unique_ptr<CallRecorder>, SetupError> open(
      recording::Recorder& recorder, rpc::Node& node, const std::vector<std::string>& urls,
      Duration deadline = std::chrono::seconds{1});
  CallRecorder(const CallRecorder&) = delete;
  CallRecorder& operator=(const CallRecorder&) = delete;
  /// Calls stop().
  ~CallRecorder();

  /// Records the calls that have ended until now, and releases the tap. May be called twice.
  /// @threads  the thread that called open()
  void stop() noexcept;
  [[nodiscard]] CallRecorderStatus status() const;

 private:
  struct Impl;
  explicit CallRecorder(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::capture
