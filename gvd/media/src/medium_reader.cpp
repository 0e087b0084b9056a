#include "rtpm/media/medium_reader.hpp"

#include <algorithm>
#include <atomic>
#include <optional>
#include <span>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/rpc/completions.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/wire/clock_sync.hpp"

namespace rtpm::media {
namespace {

/// How soon the thread notices stop().
constexpr Duration kLookInterval = std::chrono::milliseconds{50};
constexpr Duration kClockInterval = std::chrono::seconds{1};
constexpr Duration kRetryMin = std::chrono::milliseconds{200};
constexpr Duration kRetryMax = std::chrono::seconds{2};

}  // namespace

struct MediumReader::Impl {
  Impl(MediumClient bound, std::string medium, MediumReaderConfig its_config, MediumSink& its_sink)
      : client(std::move(bound)), name(std::move(medium)), config(its_config), sink(its_sink) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() { stop(); }

  void stop() noexcept {
    is_stopping.store(true, std::memory_order_release);
    ending.post();
    if (thread.is_running()) thread.join();
  }

  void run() {
    Duration pause = kRetryMin;
    while (!is_stopping.load(std::memory_order_acquire)) {
      had_piece = false;
      read();
      pause = had_piece ? kRetryMin : std::min(2 * pause, kRetryMax);
      if (ending.wait_until(rt::now() + pause)) return;
    }
  }

  /// Reads until a stream ends.
  void read() {
    if (!describe()) return;
    learn_clock();
    rpc::Completions streams;
    bool has_ended = false;
    const auto follow = [&](auto begun, auto give) {
      streams.then_each(
          std::move(begun), [this, give](const MediumItem& item) { take(item, give); },
          [this, &has_ended](const expected<void, rpc::CallError>& ended) {
            has_ended = true;
            if (is_stopping.load(std::memory_order_acquire)) return;
            tell(ended ? "its server stops" : std::string(to_string(ended.error())));
          });
    };
    const rpc::StreamOptions options{.window = config.window};
    if (has_video) {
      follow(client.frames({}, options),
             [this](const ReceivedPiece& piece) { sink.on_video(piece); });
    }
    if (has_sound) {
      follow(client.sound({}, options),
             [this](const ReceivedPiece& piece) { sink.on_sound(piece); });
    }
    MonotonicTime clock_due = rt::now() + kClockInterval;
    while (!has_ended && streams.open_count() > 0 && !is_stopping.load(std::memory_order_acquire)) {
      streams.wait(rt::now() + kLookInterval);
      if (rt::now() < clock_due) continue;
      clock_due = rt::now() + kClockInterval;
      learn_clock();
    }
  }

  bool describe() {
    const auto about = client.describe();
    if (!about) {
      tell(std::string(to_string(about.error())));
      return false;
    }
    MediumDescriptionT copy;
    (*about)->UnPackTo(&copy);
    has_video = config.wants_video && copy.video != nullptr;
    has_sound = config.wants_sound && copy.sound != nullptr;
    // The formats are complete once the pipeline has given a piece.
    is_described = (copy.video == nullptr || copy.video->codec != Codec::Unknown) &&
                   (copy.sound == nullptr || copy.sound->codec != Codec::Unknown);
    sink.on_description(copy);
    if (!has_video && !has_sound) tell("it has neither pictures nor sound that are wanted");
    return has_video || has_sound;
  }

  template <class Give>
  void take(const MediumItem& item, Give give) {
    if (item.problem() != nullptr) {
      is_described = false;  // The pipeline may come back with other formats.
      return tell(printable(item.problem()->str()));
    }
    if (item.bytes() == nullptr) return;
    if (!is_described) static_cast<void>(describe());
    had_piece = true;
    problem.clear();
    const MediumStamp& stamp = *item.stamp();
    give(ReceivedPiece{
        .bytes = std::as_bytes(std::span(item.bytes()->data(), item.bytes()->size())),
        .captured = time_from_ns(stamp.capture_ns()) - offset,
        .uncertainty = Duration{std::max<std::int64_t>(0, stamp.uncertainty_ns())} + clock_bound,
        .sequence = stamp.sequence(),
        .lost_count = stamp.lost_count(),
        .is_key = stamp.is_key()});
  }

  void learn_clock() {
    const auto clock = client.binding().ping();
    if (!clock || clock->uncertainty == Duration::max()) return;
    offset = clock->offset;
    clock_bound = clock->uncertainty;
  }

  /// Tells a problem once.
  void tell(const std::string& text) {
    if (text == problem) return;
    problem = text;
    sink.on_problem(name + ": " + text);
  }

  MediumClient client;
  std::string name;
  MediumReaderConfig config;
  MediumSink& sink;
  Duration offset{};  ///< The server's clock minus this host's.
  Duration clock_bound{};
  std::string problem{};
  bool has_video = false;
  bool has_sound = false;
  bool is_described = false;
  bool had_piece = false;
  std::atomic<bool> is_stopping{false};
  rt::Semaphore ending{};
  rt::Thread thread{};
};

expected<MediumReader, SetupError> MediumReader::start(rpc::Node& node, std::string medium,
                                                       MediumReaderConfig config,
                                                       MediumSink& sink) {
  auto client = MediumClient::bind(node, medium);
  if (!client) return unexpected{std::move(client.error())};
  auto impl = std::make_unique<Impl>(std::move(*client), std::move(medium), config, sink);
  auto started = rt::Thread::start({.name = "rtpm-media", .realtime = rt::RealtimeMode::kOff},
                                   [&reader = *impl] { reader.run(); });
  if (!started) return unexpected{std::move(started.error())};
  impl->thread = std::move(*started);
  return MediumReader{std::move(impl)};
}

MediumReader::MediumReader(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
MediumReader::MediumReader(MediumReader&&) noexcept = default;
MediumReader& MediumReader::operator=(MediumReader&&) noexcept = default;
MediumReader::~MediumReader() = default;

void MediumReader::stop() noexcept {
  impl_->stop();
}

}  // namespace rtpm::media
