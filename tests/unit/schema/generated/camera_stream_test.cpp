#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "camera.rtpm.functions.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/serve.hpp"

// A camera's pictures as stream items, with generated code, over each transport.
namespace {

using namespace std::chrono_literals;
using rtpm::rpc::CallContext;
using rtpm::rpc::CallError;
using rtpm::rpc::StreamError;
using rtpm::rpc::Transport;
using rtpm::rt::now;

constexpr auto kPatience = 20s;

std::uint8_t pixel_of(std::uint32_t number, std::size_t at) {
  return static_cast<std::uint8_t>(number * 3 + at * 7 + (at >> 8));
}

class CameraStream : public testing::TestWithParam<Transport> {
 protected:
  CameraStream() : server_(rtpm::test::serve("camera", servant_)) {}
  ~CameraStream() override {
    if (film_.joinable()) film_.join();
    server_->stop();
  }
  /// Begins a stream of pictures to a new client.
  [[nodiscard]] auto watch(std::uint32_t frame_count, std::uint32_t picture_size,
                           rtpm::rpc::NodeConfig config = {}) {
    config.transport = GetParam();
    node_.emplace(config);
    auto client =
        camera::CameraClient::bind(*node_, server_->url("camera"), {.deadline = kPatience});
    EXPECT_TRUE(client) << client.error().text();
    client_.emplace(std::move(*client));
    camera::ShotT shot;
    shot.frame_count = frame_count;
    shot.picture_size = picture_size;
    auto frames = client_->watch(shot);
    EXPECT_TRUE(frames) << to_string(frames.error());
    return std::move(*frames);
  }

  /// Sends pictures as fast as the caller takes them.
  static void film(rtpm::rpc::TableWriter<camera::Frame> frames, std::uint32_t count,
                   std::uint32_t size) {
    flatbuffers::FlatBufferBuilder builder;
    for (std::uint32_t number = 0; number < count; ++number) {
      builder.Clear();
      std::uint8_t* pixels = nullptr;
      const auto picture = builder.CreateUninitializedVector(size, &pixels);
      for (std::size_t i = 0; i < size; ++i)
        pixels[i] = pixel_of(number, i);
      builder.Finish(camera::CreateFrame(builder, number, picture));
      auto written = frames.write(builder);
      while (!written && written.error() == StreamError::kFull) {
        std::this_thread::sleep_for(100us);
        written = frames.write(builder);
      }
      if (!written) return frames.fail(rtpm::rpc::Refusal::kFailed);
    }
    frames.finish();
  }

  camera::CameraFunctionServant servant_{{
      .watch =
          [this](const camera::Shot& shot, rtpm::rpc::TableWriter<camera::Frame> frames,
                 const CallContext&) {
            const rtpm::rt::AllowAllocationScope is_allowed;
            if (film_.joinable()) film_.join();
            film_ = std::thread(
                [frames = std::move(frames), count = shot.frame_count(),
                 size = shot.picture_size()]() mutable { film(std::move(frames), count, size); });
          },
  }};
  std::unique_ptr<rtpm::rpc::Server> server_;
  std::optional<rtpm::rpc::Node> node_;
  std::optional<camera::CameraClient> client_;
  std::thread film_;
};

// hp-5.10-9
TEST_P(CameraStream, DeliversPicturesCompleteAndInOrder) {
  constexpr std::uint32_t kSize = 256 * 1024;
  auto frames = watch(20, kSize);
  for (std::uint32_t number = 0; number < 20; ++number) {
    const auto frame = frames.next(now() + kPatience);
    ASSERT_TRUE(frame) << number << ": " << to_string(frame.error());
    ASSERT_NE(*frame, nullptr);
    ASSERT_EQ((*frame)->number(), number);
    const auto* const picture = (*frame)->picture();
    ASSERT_EQ(picture->size(), kSize);
    std::size_t at = 0;
    EXPECT_TRUE(std::ranges::all_of(*picture, [&](std::uint8_t pixel) {
      return pixel == pixel_of(number, at++);
    })) << number;
  }
  const auto end = frames.next(now() + kPatience);
  ASSERT_TRUE(end) << to_string(end.error());
  EXPECT_EQ(*end, nullptr);
}

// hp-5.10-10
TEST_P(CameraStream, ReportsAPictureThatIsTooLarge) {
  rtpm::rpc::NodeConfig config;
  config.message_size_max = 100'000;
  auto frames = watch(1, 100'000, config);
  const auto frame = frames.next(now() + kPatience);
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error(), CallError::kTooLarge) << to_string(frame.error());
}

INSTANTIATE_TEST_SUITE_P(Transports, CameraStream,
                         testing::Values(Transport::kUdp, Transport::kTcp,
                                         Transport::kSharedMemory));

}  // namespace
