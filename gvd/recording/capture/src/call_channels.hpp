#pragma once

#include <introspection.rtpm.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/recording/recorder.hpp"

namespace rtpm::capture {

/// Times of a call, converted to the recording's clock.
struct CallTimes {
  std::uint64_t received_ns = 0;
  std::uint64_t finished_ns = 0;
  std::uint64_t log_ns = 0;
};

/// The channels of an object's calls.
/// @threads  one
class CallChannels {
 public:
  /// @errors  an error of the file
  [[nodiscard]] static expected<std::unique_ptr<CallChannels>, SetupError> create(
      recording::Recorder& recorder, recording::Recorder::Track& track, std::string path,
      std::unique_ptr<dynamic::RemoteObject> object);

  /// Records a tap's report of a call. Returns the number of payloads that did not match their
  /// schema.
  int record(const introspection::TappedCall& call, ConstBytes request, ConstBytes reply,
             const CallTimes& times);

 private:
  enum class Part : std::uint8_t { kRequest, kResponse };
  CallChannels(recording::Recorder& recorder, recording::Recorder::Track& track, std::string path,
               std::unique_ptr<dynamic::RemoteObject> object) noexcept;
  [[nodiscard]] expected<void, SetupError> add_record_channel();
  [[nodiscard]] const schema::Method* method_of(std::uint16_t id) const noexcept;
  /// Finds or adds the channel of a method's part; nullopt if the file takes no more channels.
  [[nodiscard]] std::optional<std::uint16_t> channel_of(const schema::Method& method, Part part);
  /// Records a payload; false if it does not match its schema.
  bool record_payload(const schema::Method& method, Part part, ConstBytes payload,
                      recording::Message message);
  void record_end(const introspection::TappedCall& call, const schema::Method* method,
                  const CallTimes& times);

  recording::Recorder& recorder_;
  recording::Recorder::Track& track_;
  std::string path_;
  std::unique_ptr<dynamic::RemoteObject> object_;
  std::uint16_t record_channel_ = 0;
  std::map<std::pair<std::uint16_t, Part>, std::uint16_t> channels_{};
  flatbuffers::FlatBufferBuilder builder_{};
};

}  // namespace rtpm::capture
