#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/media/medium_reader.hpp"
#include "rtpm/media/medium_server.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/sealed_files.hpp"
#include "rtpm/test/serve.hpp"

// Pictures and sound as streams: what readers get, fast ones and slow ones.
namespace rtpm::media {
namespace {

using namespace std::chrono_literals;

constexpr auto kPatience = 20s;
constexpr std::size_t kSize = 100'000;  // A picture that is larger than a frame of any transport.

/// Keeps what it receives.
class Kept final : public MediumSink {
 public:
  void on_description(const MediumDescriptionT& about) override {
    const std::lock_guard lock(mutex_);
    about_.frame = about.frame;
    codec_ = about.video == nullptr ? Codec::Unknown : about.video->codec;
  }
  void on_video(const ReceivedPiece& piece) override { keep(pictures_, piece); }
  void on_sound(const ReceivedPiece& piece) override { keep(sounds_, piece); }
  void on_problem(const std::string& problem) override {
    const std::lock_guard lock(mutex_);
    problems_.push_back(problem);
  }
  [[nodiscard]] std::vector<ReceivedPiece> pictures() const { return copy(pictures_); }
  [[nodiscard]] std::vector<ReceivedPiece> sounds() const { return copy(sounds_); }
  [[nodiscard]] std::vector<std::string> problems() const { return copy(problems_); }
  [[nodiscard]] Codec codec() const {
    const std::lock_guard lock(mutex_);
    return codec_;
  }

 private:
  void keep(std::vector<ReceivedPiece>& pieces, ReceivedPiece piece) {
    const std::lock_guard lock(mutex_);
    piece.bytes = {};
    pieces.push_back(piece);
  }
  template <class T>
  [[nodiscard]] std::vector<T> copy(const std::vector<T>& kept) const {
    const std::lock_guard lock(mutex_);
    return kept;
  }

  mutable std::mutex mutex_;
  MediumDescriptionT about_{};
  Codec codec_ = Codec::Unknown;
  std::vector<ReceivedPiece> pictures_{};
  std::vector<ReceivedPiece> sounds_{};
  std::vector<std::string> problems_{};
};

class MediumTest : public testing::Test {
 protected:
  MediumTest() {
    VideoFormatT video;
    video.codec = Codec::H264;
    medium_.set_video(video);
    SoundFormatT sound;
    sound.codec = Codec::PcmS16;
    medium_.set_sound(sound);
    medium_.begin();
  }
  ~MediumTest() override {
    if (server_ != nullptr) server_->stop();
  }
  static MediumDescriptionT about() {
    MediumDescriptionT about;
    about.model = "test";
    about.serial = "1";
    about.frame = "optical";
    return about;
  }
  bool push(bool is_key, MonotonicTime captured = rt::now()) {
    return medium_.push_video(
        {.bytes = bytes_, .captured = captured, .uncertainty = 3ms, .is_key = is_key});
  }
  [[nodiscard]] std::string url() const { return server_->url("cam"); }
  [[nodiscard]] MediumClient client() {
    auto bound = MediumClient::bind(node_, url(), {.deadline = kPatience});
    EXPECT_TRUE(bound) << bound.error().text();
    return std::move(*bound);
  }
  /// Readers, as the server sees them.
  [[nodiscard]] std::uint32_t reader_count(MediumClient& medium) {
    const auto state = medium.state();
    return state ? (*state)->reader_count() : 99;
  }

  std::vector<std::byte> bytes_{kSize};
  MediumServer medium_{about()};
  std::unique_ptr<rpc::Server> server_{test::serve("cam", medium_)};
  rpc::Node node_{{.default_deadline = 5s}};
};

TEST_F(MediumTest, AReaderBeginsWithAKeyFrameForWhichTheEncoderIsAsked) {
  Kept kept;
  const auto reader = MediumReader::start(node_, url(), {}, kept);
  ASSERT_TRUE(reader) << reader.error().text();
  MediumClient asked = client();
  ASSERT_TRUE(test::await([&] { return reader_count(asked) == 2; }));
  EXPECT_EQ(kept.codec(), Codec::H264);
  EXPECT_TRUE(push(false));
  EXPECT_FALSE(push(false)) << "a second request within the interval";
  const MonotonicTime captured = rt::now() - 7ms;
  EXPECT_FALSE(push(true, captured));
  ASSERT_TRUE(test::await([&] { return kept.pictures().size() == 1; }));
  const ReceivedPiece first = kept.pictures().front();
  EXPECT_TRUE(first.is_key);
  EXPECT_EQ(first.sequence, 3);
  EXPECT_EQ(first.lost_count, 0);
  // Both sides have this host's clock.
  EXPECT_EQ(first.captured, captured);
  EXPECT_EQ(first.uncertainty, 3ms);
  medium_.push_sound({.bytes = ConstBytes(bytes_).first(960), .captured = rt::now()});
  EXPECT_TRUE(test::await([&] { return kept.sounds().size() == 1; }));
}

TEST_F(MediumTest, ASlowReaderGetsTheNewestKeyFrameAndNoQueue) {
  MediumClient slow = client();
  auto stream = slow.frames({}, {.window = 2});
  ASSERT_TRUE(stream);
  ASSERT_TRUE(test::await([&] { return reader_count(slow) == 1; }));
  static_cast<void>(push(true));
  const auto first = stream->next(rt::now() + kPatience);
  ASSERT_TRUE(first && *first != nullptr);
  EXPECT_EQ((*first)->stamp()->sequence(), 1);
  // It takes nothing: at most the window and one more are kept for it.
  constexpr std::uint64_t kCount = 60;
  bool is_asked = false;
  const MonotonicTime begin = rt::now();
  for (std::uint64_t i = 0; i < kCount; ++i)
    is_asked = push(false, begin + i * 33ms) || is_asked;
  EXPECT_TRUE(is_asked) << "the encoder was not asked for a key frame";
  std::uint64_t old_count = 0;
  std::optional<std::uint64_t> key;
  while (!key) {
    auto item = stream->next(rt::now() + 100ms);
    if (!item) {
      ASSERT_EQ(item.error(), rpc::CallError::kTimeout);
      static_cast<void>(push(true));
      continue;
    }
    ASSERT_NE(*item, nullptr);
    if (!(*item)->stamp()->is_key()) {
      ++old_count;
      EXPECT_EQ((*item)->stamp()->lost_count(), 0) << "a picture after a gap can't be decoded";
      continue;
    }
    key = (*item)->stamp()->sequence();
    EXPECT_EQ((*item)->stamp()->lost_count(), *key - 2 - old_count);
  }
  EXPECT_LE(old_count, 3);
  EXPECT_GT(*key, kCount);
}

TEST_F(MediumTest, AReaderThatDiesIsForgotten) {
  MediumClient asked = client();
  {
    rpc::Node other({.default_deadline = 5s});
    auto bound = MediumClient::bind(other, url(), {.deadline = kPatience});
    ASSERT_TRUE(bound);
    const auto stream = bound->frames();
    ASSERT_TRUE(stream);
    ASSERT_TRUE(test::await([&] { return reader_count(asked) == 1; }));
  }
  EXPECT_TRUE(test::await([&] {
    static_cast<void>(push(true));
    return reader_count(asked) == 0;
  }));
}

TEST_F(MediumTest, RefusesMoreReadersThanItHasPlacesFor) {
  MediumClient asked = client();
  std::vector<rpc::TableStream<MediumItem>> streams;
  std::optional<rpc::CallError> refused;
  while (!refused && streams.size() <= MediumServer::kReaderCountMax) {
    auto stream = asked.frames();
    ASSERT_TRUE(stream);
    const auto item = stream->next(rt::now() + 50ms);
    if (!item && item.error() != rpc::CallError::kTimeout) refused = item.error();
    streams.push_back(std::move(*stream));
  }
  EXPECT_EQ(refused, rpc::CallError::kOverload);
}

TEST_F(MediumTest, TellsReadersWhyNothingComesAndGoesOnAfterwards) {
  Kept kept;
  const auto reader = MediumReader::start(node_, url(), {.wants_sound = false}, kept);
  ASSERT_TRUE(reader);
  MediumClient asked = client();
  ASSERT_TRUE(test::await([&] { return reader_count(asked) == 1; }));
  medium_.report("the cable is out");
  ASSERT_TRUE(test::await([&] { return !kept.problems().empty(); }));
  EXPECT_EQ(kept.problems().front(), url() + ": the cable is out");
  {
    const auto state = asked.state();
    ASSERT_TRUE(state);
    EXPECT_EQ((*state)->lifecycle(), 3);
    EXPECT_EQ((*state)->problem()->str(), "the cable is out");
  }
  medium_.begin();
  static_cast<void>(push(true));
  EXPECT_TRUE(test::await([&] { return kept.pictures().size() == 1; }));
  const auto state = asked.state();
  ASSERT_TRUE(state);
  EXPECT_EQ((*state)->lifecycle(), 2);
  EXPECT_EQ((*state)->restart_count(), 1);
}

TEST_F(MediumTest, AReaderFindsARestartedServerAgain) {
  Kept kept;
  const std::string target = url();
  const std::uint16_t port = static_cast<std::uint16_t>(
      std::stoi(target.substr(target.rfind(':') + 1, target.rfind('/'))));
  const auto reader = MediumReader::start(node_, target, {.wants_sound = false}, kept);
  ASSERT_TRUE(reader);
  server_->stop();
  server_.reset();
  ASSERT_TRUE(test::await([&] { return !kept.problems().empty(); }));
  server_ = test::serve("cam", medium_, {.port = port});
  ASSERT_NE(server_, nullptr);
  EXPECT_TRUE(test::await([&] {
    static_cast<void>(push(true));
    return !kept.pictures().empty();
  }));
}

TEST(MediumAccess, AStrangerIsRefused) {
  const rpc::test::SealedFiles files;
  MediumServer medium{MediumDescriptionT{}};
  const auto server = test::serve("cam", medium, {.security = files.of_server()});
  ASSERT_NE(server, nullptr);
  Kept kept;
  // Over shared memory it would be the server's own user.
  rpc::Node stranger({.transport = rpc::Transport::kTcp});
  const auto refused = MediumReader::start(stranger, server->url("cam"), {}, kept);
  EXPECT_FALSE(refused);
  rpc::Node known({.security = files.of_node()});
  const auto reader = MediumReader::start(known, server->url("cam"), {}, kept);
  EXPECT_TRUE(reader) << reader.error().text();
}

}  // namespace
}  // namespace rtpm::media
