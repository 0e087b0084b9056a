#pragma once

#include <gst/app/gstappsrc.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gstreamer.hpp"
#include "pipeline.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::camerad {

/// A picture and a sound without a camera, for the pipeline's appsrc elements "test_video" and
/// "test_sound": each picture shows the time of its capture as a bar code (see bar_code.hpp), and a
/// lamp and a tone follow the first button of a device.
///
/// A picture stamped t shows the button as it was at t, at most one picture late: the source reads
/// the device at t until it has a sample from t or later. A picture for which that comes too late is left
/// out, as a camera leaves out those that it can't expose.
/// @ownership refers to its pipeline and its node, which must outlive it
/// @threads  create and destroy from one thread
class TestSource {
 public:
  static constexpr std::uint32_t kWidth = 640;
  static constexpr std::uint32_t kHeight = 480;
  static constexpr std::uint32_t kPictureRateHz = 30;
  static constexpr std::uint32_t kSampleRateHz = 48000;
  static constexpr std::uint32_t kSoundRateHz = 50;  ///< Pieces per second.
  /// How long lamp and tone last.
  static constexpr Duration kLit = std::chrono::milliseconds{100};

  /// Starts the source if the pipeline has such an element, else gives null.
  /// @errors   the device does not answer
  /// @param device  whose button lights the lamp, by name or URL; empty: none
  [[nodiscard]] static expected<std::unique_ptr<TestSource>, SetupError> start(
      const Pipeline& pipeline, rpc::Node& node, const std::string& device);
  TestSource(const TestSource&) = delete;
  TestSource& operator=(const TestSource&) = delete;
  ~TestSource();

 private:
  class Button;
  /// One of the two elements, and its thread.
  struct Feed {
    Feed();
    ~Feed();
    Owned<GstElement> source{};
    std::unique_ptr<Button> button{};
    rt::Thread thread{};
    rt::Semaphore ending{};
  };
  explicit TestSource(const Pipeline& pipeline) noexcept;
  [[nodiscard]] expected<void, SetupError> start(Feed& feed, const char* caps_text,
                                                 void (TestSource::*run)(Feed&));
  void show(Feed& feed);
  void sound(Feed& feed);
  template <class Make>
  void give(Feed& feed, Duration period, Duration delay, Make make);

  const Pipeline& pipeline_;
  std::unique_ptr<gvd::DeviceClient> device_{};
  Feed video_{};
  Feed sound_{};
};

}  // namespace rtpm::camerad
