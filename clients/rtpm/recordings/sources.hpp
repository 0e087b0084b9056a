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

/// What is recorded.
struct SourceRequest : EventRequest {
  bool is_hub_given = false;
  std::vector<std::string> devices{};  ///< To be polled, by name.
  double poll_rate_hz = 60;
  std::vector<std::string> calls{};  ///< Objects whose calls are tapped, by name or URL.

  /// Whether events are asked for, not only taken along.
  [[nodiscard]] bool needs_hub() const { return is_hub_given || filter != "all"; }
};

/// What the sources of a recording did so far.
struct SourceCounts {
  std::uint64_t lost = 0;  ///< Messages that did not come as far as the recorder.
  std::uint64_t calls = 0;
  std::uint64_t omitted_payloads = 0;
  std::uint64_t unreadable_payloads = 0;
};

/// What puts messages into a recording, beside others.
class Source {
 public:
  Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;
  virtual ~Source() = default;
  /// Attends to it and tells what went wrong. Called now and then.
  virtual void care() {}
  virtual void add_to(SourceCounts&) const {}
  /// Why nothing comes from it any more.
  [[nodiscard]] virtual std::optional<SetupError> problem() const { return std::nullopt; }
  /// Takes what is there, and ends it; its counts stay.
  virtual void end() {}
};

/// All that goes into a recording.
/// @ownership refers to context, request and recorder
/// @threads  one
class Sources {
 public:
  Sources(Context& context, const SourceRequest& request, recording::Recorder& recorder);

  /// Opens all that is asked for.
  /// @return kDone, or the exit code of the error that was told
  [[nodiscard]] int open();
  /// Attends to them and tells what went wrong. Call it now and then.
  void care();
  [[nodiscard]] SourceCounts counts() const;
  /// Why one of them ended by itself.
  [[nodiscard]] std::optional<SetupError> problem() const;
  /// Takes what is there, and ends them; their counts stay.
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
