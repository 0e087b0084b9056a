#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/context.hpp"
#include "events/subscription.hpp"
#include "rtpm/capture/device_recorder.hpp"
#include "rtpm/recording/recorder.hpp"

namespace rtpm::tool {

/// The sources to record.
struct SourceRequest : EventRequest {
  bool is_hub_given = false;
  std::vector<std::string> devices{};  ///< Devices to poll, by name.
  double poll_rate_hz = 60;
  std::vector<std::string> calls{};  ///< Objects whose calls are tapped, by name or URL.

  /// Whether events were requested explicitly.
  [[nodiscard]] bool needs_hub() const { return is_hub_given || filter != "all"; }
};

/// The counts of a recording's sources so far.
struct SourceCounts {
  std::uint64_t lost = 0;  ///< Messages that did not reach the recorder.
  std::uint64_t calls = 0;
  std::uint64_t omitted_payloads = 0;
  std::uint64_t unreadable_payloads = 0;
};

/// A source of messages for a recording.
class Source {
 public:
  Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;
  virtual ~Source() = default;
  /// Does periodic work and reports problems. Called periodically.
  virtual void care() {}
  virtual void add_to(SourceCounts&) const {}
  /// The reason why the source has ended; nullopt if it has not.
  [[nodiscard]] virtual std::optional<SetupError> problem() const { return std::nullopt; }
  /// Takes the remaining messages, and ends the source; its counts stay.
  virtual void end() {}
};

/// All sources of a recording.
/// @ownership refers to context, request and recorder
/// @threads  one
class Sources {
 public:
  Sources(Context& context, const SourceRequest& request, recording::Recorder& recorder);

  /// Opens all requested sources.
  /// @return kDone, or the exit code of the reported error
  [[nodiscard]] int open();
  /// Does the sources' periodic work and reports problems. Call it periodically.
  void care();
  [[nodiscard]] SourceCounts counts() const;
  /// The reason why a source ended by itself; nullopt if none did.
  [[nodiscard]] std::optional<SetupError> problem() const;
  /// Takes the remaining messages, and ends the sources; their counts stay.
  void end();

 private:
  int open_calls();
  int poll_devices();
  int open_hub();

  Context& context_;
  const SourceRequest& request_;
  recording::Recorder& recorder_;
  capture::DeviceRecorder devices_;
  std::vector<std::unique_ptr<Source>> list_{};
};

}  // namespace rtpm::tool
