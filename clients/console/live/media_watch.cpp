#include "live/media_watch.hpp"

#include <atomic>
#include <optional>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::console {
namespace {

/// How soon a camera that could not be bound is tried again.
constexpr Duration kMediumRetryInterval = std::chrono::seconds{2};

}  // namespace

/// One camera that is watched.
class MediaWatch::Camera final : public media::MediumSink {
 public:
  Camera(MediaWatch& watch, std::string name) : watch_(watch), name_(std::move(name)) {
    view_.name = name_;
  }

  /// Starts reading unless it does.
  void look() {
    if (reader_ || rt::now() < next_) return;
    auto started =
        media::MediumReader::start(watch_.node_, name_, {.wants_sound = false, .window = 2}, *this);
    if (started) {
      reader_.emplace(std::move(*started));
    } else {
      next_ = rt::now() + kMediumRetryInterval;
      on_problem(started.error().text());
    }
  }

  void on_description(const media::MediumDescriptionT& about) override {
    view_.frame = about.frame;
    if (!about.video) return;
    codec_ = about.video->codec;
    view_.width_px = about.video->width_px;
    view_.height_px = about.video->height_px;
    view_.rate_hz = about.video->rate_hz;
  }

  void on_video(const media::ReceivedPiece& piece) override {
    const bool is_image = codec_ == media::Codec::Jpeg;
    if (!is_image && codec_ != media::Codec::H264) return;
    needs_key_ = (needs_key_ || *waiting_count_ >= kWaitingMax) &&
                 !(piece.is_key && *waiting_count_ < kWaitingMax);
    if (needs_key_) return;
    view_.problem.clear();
    view_.type = is_image ? viewers::Type::kCompressedImage : viewers::Type::kCompressedVideo;
    view_.log_time_ns = rt::utc_ns(piece.captured);
    view_.is_key = piece.is_key;
    view_.uncertainty = piece.uncertainty;
    view_.lost_count = piece.lost_count;
    const viewers::Stamp stamp{.time_ns = view_.log_time_ns, .frame = view_.frame};
    const viewers::Message message = is_image ? viewers::image_message(stamp, "jpeg", piece.bytes)
                                              : viewers::video_message(stamp, "h264", piece.bytes);
    view_.message.assign(reinterpret_cast<const char*>(message.data()), message.size());
    post();
  }
  void on_sound(const media::ReceivedPiece&) override {}
  void on_problem(const std::string& problem) override {
    view_.message.clear();
    view_.problem = problem;
    post();
  }

 private:
  void post() {
    ++*waiting_count_;
    watch_.post_([receive = watch_.receive_, view = view_, count = waiting_count_] {
      --*count;
      receive(view);
    });
  }

  MediaWatch& watch_;
  std::string name_;
  MediumView view_{};
  media::Codec codec_ = media::Codec::Unknown;
  bool needs_key_ = false;
  std::shared_ptr<std::atomic<int>> waiting_count_ = std::make_shared<std::atomic<int>>(0);
  MonotonicTime next_{};
  std::optional<media::MediumReader> reader_{};
};

MediaWatch::MediaWatch(rpc::Node& node, Post post, std::function<void(const MediumView&)> receive)
    : node_(node), post_(std::move(post)), receive_(std::move(receive)) {}
MediaWatch::~MediaWatch() = default;

void MediaWatch::set_watched(std::set<std::string> names) {
  const std::lock_guard lock(mutex_);
  watched_ = std::move(names);
}

void MediaWatch::look() {
  std::set<std::string> watched;
  {
    const std::lock_guard lock(mutex_);
    watched = watched_;
  }
  std::erase_if(cameras_, [&](const auto& one) { return !watched.contains(one.first); });
  for (const std::string& name : watched) {
    auto& camera = cameras_[name];
    if (!camera) camera = std::make_unique<Camera>(*this, name);
    camera->look();
  }
}

void MediaWatch::stop() {
  cameras_.clear();
}

}  // namespace rtpm::console
