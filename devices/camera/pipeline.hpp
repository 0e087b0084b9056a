#pragma once

#include <gst/app/gstappsink.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "gstreamer.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/media/medium_server.hpp"

namespace rtpm::camerad {

/// The pictures and sound that a server of a medium gets from a GStreamer pipeline, whose appsink
/// elements are named "video" and "sound". Its clock is the system's monotonic one, so the capture
/// time of a buffer is the pipeline's base time plus the buffer's running time.
/// @ownership refers to its server, which must outlive it
/// @threads  one, but pieces come on the pipeline's own threads
/// @realtime set-up only
class Pipeline {
 public:
  /// Makes the pipeline of `text`, and sets the server's formats as far as they are known.
  /// @param uncertainty  of capture times; 0: the duration of a piece
  /// @errors   the text is wrong; an element is missing, with its Debian package; no appsink
  [[nodiscard]] static expected<std::unique_ptr<Pipeline>, SetupError> create(
      const std::string& text, Duration uncertainty, media::MediumServer& server);
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;
  /// Stops the pipeline.
  ~Pipeline();

  /// Starts it; an error comes by wait_for_end().
  void play();
  /// Waits until the pipeline fails or ends, at most until `until`; nullopt if it runs on.
  [[nodiscard]] std::optional<SetupError> wait_for_end(MonotonicTime until);
  /// The number of pieces that it has given.
  [[nodiscard]] std::uint64_t piece_count() const noexcept {
    return piece_count_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] GstBin& bin() const noexcept { return *GST_BIN(pipeline_.get()); }
  /// The element with that name; null if there is none.
  [[nodiscard]] Owned<GstElement> element(const std::string& name) const;

 private:
  /// One appsink.
  struct Outlet {
    Pipeline* pipeline = nullptr;
    Owned<GstElement> sink{};
    bool is_video = false;
    Owned<GstCaps> caps{};  ///< The newest piece's.
    Duration period{};      ///< From one picture to the next, by the caps.
  };

  Pipeline(Owned<GstElement> pipeline, Duration uncertainty, media::MediumServer& server);
  void connect(Outlet& outlet, const char* name, const char* caps);
  static GstFlowReturn on_sample(GstAppSink* sink, void* outlet);
  [[nodiscard]] GstFlowReturn take(Outlet& outlet, GstSample& sample);
  void learn_format(Outlet& outlet, GstCaps& caps);
  void learn_latency();

  Owned<GstElement> pipeline_;
  Owned<GstBus> bus_;
  Duration uncertainty_;
  media::MediumServer& server_;
  Outlet video_{};
  Outlet sound_{};
  std::atomic<std::uint64_t> piece_count_{0};
  bool has_latency_ = false;
};

}  // namespace rtpm::camerad
