#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/configuration/client.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::capture {

/// Settings for ParameterRecorder::start().
struct ParameterRecorderConfig {
  std::string hub{events::kHubPath};                   ///< Reports changes; may be absent.
  std::vector<std::string> devices{};                  ///< The names of the first ones; see add().
  Duration deadline = std::chrono::milliseconds{300};  ///< Bounds each call.
};

/// Records the parameters of devices, which include the results of calibrations: all of them when
/// the device is added, and again after each change. Topic "lab/arm0/parameters", the device's
/// unchanged reply to `list`; its publish time is that of the change. A change is noticed by its
/// event, or else within 2 s.
/// @ownership owns a thread "rtpm-parameters"; refers to its node and recorder
/// @threads  any
/// @realtime none
class ParameterRecorder {
 public:
  /// Does not wait for the devices.
  /// @errors   no thread could be started
  [[nodiscard]] static expected<std::unique_ptr<ParameterRecorder>, SetupError> start(
      rpc::Node& node, recording::Recorder& recorder, ParameterRecorderConfig config);
  ParameterRecorder(const ParameterRecorder&) = delete;
  ParameterRecorder& operator=(const ParameterRecorder&) = delete;
  ~ParameterRecorder();

  /// Adds a device, by name; one that was added before has no effect. Call it before stop().
  void add(std::string device);
  /// Messages since the last call: devices whose parameters could not be read.
  [[nodiscard]] std::vector<std::string> take_reports();
  /// Records the devices that were added and the changes that were reported, for at most a second,
  /// and ends. Call it before the recorder is closed.
  void stop();

 private:
  struct Impl;
  explicit ParameterRecorder(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// The metadata with the devices whose parameters are missing, and why.
inline constexpr const char* kMissingParametersMetadata = "rtpm.missing_parameters";

/// A change of a device's parameters.
/// @ownership a value
struct ParameterChange {
  std::uint64_t time_ns = 0;  ///< Since 1970 in UTC.
  std::uint64_t revision = 0;
  std::vector<driver::ParameterSetting> settings{};  ///< The values that differ from before.
};

/// The parameters of a device in a recording.
/// @ownership a value
struct RecordedParameters {
  std::string device{};
  gvd::DeviceConfiguration first{};
  gvd::DeviceConfiguration last{};  ///< At the end of the part that was read.
  std::vector<ParameterChange> changes{};
  std::uint64_t omitted_count = 0;  ///< Changes beyond kChangedValuesMax.
};
/// The most changed values that read_parameters() lists, of all devices.
inline constexpr std::size_t kChangedValuesMax = 100'000;

/// The recorded parameters of all devices, by name.
/// @param to_ns  the last log time that is read
/// @errors   those of FileReader::read(); recorded with another version of the configuration's
///           interface; a broken message
[[nodiscard]] expected<std::vector<RecordedParameters>, SetupError> read_parameters(
    recording::FileReader& reader, std::uint64_t to_ns = UINT64_MAX);

}  // namespace rtpm::capture
