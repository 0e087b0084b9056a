#include <memory>
#include <string>
#include <utility>

#include "guard.hpp"
#include "node.hpp"
#include "rtpm/capture/live_recording.hpp"

using namespace rtpm;

struct rtpm_recording {
  std::unique_ptr<capture::LiveRecording> live;
};

rtpm_status rtpm_recording_start(rtpm_node* node, const char* file, const char* hub,
                                 const char* const* devices, uint32_t device_count,
                                 rtpm_recording** recording) {
  return c::guarded([&] {
    if (node == nullptr || file == nullptr || recording == nullptr)
      return c::invalid("rtpm_recording_start: node, file and recording must not be NULL");
    if (devices == nullptr && device_count > 0)
      return c::invalid("rtpm_recording_start: devices is NULL");
    capture::LiveRecordingConfig config{.registry = node->where,
                                        .devices = {devices, devices + device_count}};
    if (hub != nullptr) config.hub = hub;
    config.recorder.writer.profile = "rtpm";
    auto live = capture::LiveRecording::start(node->node, file, std::move(config));
    if (!live) return c::failed(live.error(), RTPM_FAILED);
    *recording = new rtpm_recording{std::move(*live)};
    return rtpm_status{RTPM_OK};
  });
}

rtpm_status rtpm_recording_annotate(rtpm_recording* recording, const char* text) {
  return c::guarded([&] {
    if (recording == nullptr || text == nullptr)
      return c::invalid("rtpm_recording_annotate: recording and text must not be NULL");
    if (recording->live->annotate(text)) return rtpm_status{RTPM_OK};
    return c::failed(RTPM_REFUSED, "the remark is too long, or the recorder is full");
  });
}

rtpm_status rtpm_recording_stop(rtpm_recording* recording, uint64_t* message_count,
                                uint64_t* lost_count) {
  return c::guarded([&] {
    if (recording == nullptr) return c::invalid("rtpm_recording_stop: recording is NULL");
    const std::unique_ptr<rtpm_recording> owned(recording);
    const auto stopped = recording->live->stop();
    const auto status = recording->live->status();
    if (message_count != nullptr) *message_count = status.recorder.message_count;
    if (lost_count != nullptr) *lost_count = status.recorder.drop_count + status.lost_count;
    return stopped ? rtpm_status{RTPM_OK} : c::failed(stopped.error(), RTPM_FAILED);
  });
}
