#include "sides/memory_floor.hpp"

#include <sys/mman.h>

#include <array>
#include <atomic>
#include <cstring>
#include <new>
#include <utility>

#include "rtpm/rt/memory.hpp"
#include "sides/memory_wait.hpp"

namespace rtpm::bench {
namespace {

constexpr Duration kTimeout = std::chrono::seconds{1};
constexpr std::size_t kCallerCountMax = 65;
constexpr std::size_t kLaneCountMax = 2;
// As many bytes as RTPM's ring has.
constexpr std::size_t kSlotCount = 1024;

using Frame = std::array<std::byte, kFloorFrameSize>;
static_assert(sizeof(Frame) == 112);

/// One direction of one caller's path.
struct Ring {
  struct alignas(128) Slot {
    Frame frame{};
  };
  alignas(64) std::atomic<std::uint64_t> tail{0};
  alignas(64) std::atomic<std::uint64_t> head{0};
  std::array<Slot, kSlotCount> slots{};

  void push(const Frame& frame, std::uint64_t position) noexcept {
    slots[position % kSlotCount].frame = frame;
    tail.store(position + 1, std::memory_order_seq_cst);
  }
  [[nodiscard]] bool has(std::uint64_t position) const noexcept {
    return tail.load(std::memory_order_seq_cst) != position;
  }
  void pop(Frame& frame, std::uint64_t position) noexcept {
    frame = slots[position % kSlotCount].frame;
    head.store(position + 1, std::memory_order_release);
  }
};

struct Path {
  Ring to_server;
  Ring to_caller;
  Bed caller_bed;
};

}  // namespace

struct MemoryFloor::Lane {
  Bed bed;
  std::array<Path, kCallerCountMax> paths;
};

struct MemoryFloor::Layout {
  std::array<Lane, kLaneCountMax> lanes;
};

namespace {

class MemoryFloorCaller final : public Caller {
 public:
  MemoryFloorCaller(Path& path, Bed& lane_bed, const rt::WaitConfig& wait)
      : path_(path), lane_bed_(lane_bed), spin_(spin_of(wait, kTimeout)), wait_(wait) {
    for (std::size_t i = wire::kHeaderSize; i < sent_.size(); ++i)
      sent_[i] = static_cast<std::byte>(i);
  }

  expected<void, std::string> echo() override { return exchange(); }

  expected<void, std::string> work(Duration duration) override {
    store_le(sent_.data(), static_cast<std::uint64_t>(duration.count()));
    auto outcome = exchange();
    store_le(sent_.data(), std::uint64_t{0});
    return outcome;
  }

 private:
  expected<void, std::string> exchange() {
    const auto has_reply = [this] { return path_.to_caller.has(position_); };
    path_.to_server.push(sent_, position_);
    lane_bed_.wake();
    if (!spin_until(has_reply, spin_)) {
      const bool may_sleep = wait_.strategy != rt::WaitStrategy::kSpin;
      if (!may_sleep || !path_.caller_bed.sleep_until(has_reply)) {
        return unexpected{std::string("the raw floor's server does not answer")};
      }
    }
    path_.to_caller.pop(received_, position_);
    ++position_;
    if (!are_same(received_, sent_)) return unexpected{std::string("the raw floor's echo differs")};
    return {};
  }

  Path& path_;
  Bed& lane_bed_;
  Duration spin_;
  rt::WaitConfig wait_;
  std::uint64_t position_ = 0;
  Frame sent_{};
  Frame received_{};
};

void compute_as_asked(const Frame& frame) noexcept {
  const auto duration_ns = load_le<std::uint64_t>(frame.data());
  if (duration_ns != 0) compute_for(Duration{static_cast<Duration::rep>(duration_ns)});
}

void serve_lane(Bed& bed, std::span<Path> paths, const rt::WaitConfig& wait) noexcept {
  std::vector<std::uint64_t> positions(paths.size());
  const auto has_work = [&] {
    for (std::size_t i = 0; i < paths.size(); ++i) {
      if (paths[i].to_server.has(positions[i])) return true;
    }
    return false;
  };
  const Duration spin = spin_of(wait, Duration::max());
  Frame frame{};
  for (;;) {
    for (std::size_t i = 0; i < paths.size(); ++i) {
      if (!paths[i].to_server.has(positions[i])) continue;
      paths[i].to_server.pop(frame, positions[i]);
      compute_as_asked(frame);
      paths[i].to_caller.push(frame, positions[i]++);
      paths[i].caller_bed.wake();
    }
    if (!spin_until(has_work, spin)) bed.sleep(has_work);
  }
}

}  // namespace

expected<std::unique_ptr<MemoryFloor>, std::string> MemoryFloor::create(
    const std::vector<int>& caller_counts) {
  void* const memory =
      mmap(nullptr, sizeof(Layout), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return unexpected{std::string("no memory for the raw floor")};
  // Fresh memory is zeros, and nothing else is what the words begin with.
  return std::unique_ptr<MemoryFloor>(
      new MemoryFloor(std::launder(static_cast<Layout*>(memory)), sizeof(Layout), caller_counts));
}

MemoryFloor::~MemoryFloor() {
  munmap(layout_, size_);
}

expected<void, std::string> MemoryFloor::serve(const std::vector<FloorLaneConfig>& lanes,
                                               rt::RealtimeMode realtime) {
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    Lane& lane = layout_->lanes[i];
    const std::span<Path> paths(lane.paths.data(), static_cast<std::size_t>(caller_counts_[i]));
    for (Path& path : paths) {
      // Pages are there before the first call.
      std::memset(static_cast<void*>(&path), 0, sizeof path);
    }
    const FloorLaneConfig& config = lanes[i];
    auto thread = rt::Thread::start(
        {.name = config.name,
         .priority = config.priority,
         .cpus = {config.cpu},
         .realtime = realtime},
        [&bed = lane.bed, paths, wait = config.wait] { serve_lane(bed, paths, wait); });
    if (!thread) return unexpected{thread.error().text()};
    static auto& started = *new std::vector<rt::Thread>;
    started.push_back(std::move(*thread));
  }
  if (auto locked = rt::lock_memory(realtime); !locked) return unexpected{locked.error().text()};
  return {};
}

std::unique_ptr<Caller> MemoryFloor::connect(std::size_t lane, const rt::WaitConfig& wait) {
  Lane& its_lane = layout_->lanes[lane];
  const auto index = static_cast<std::size_t>(connected_counts_[lane]++);
  Path& path = its_lane.paths.at(index);
  // Here, too: the first thousand calls go to slots that this process has not touched.
  rt::prefault({reinterpret_cast<std::byte*>(&path), sizeof path});
  return std::make_unique<MemoryFloorCaller>(path, its_lane.bed, wait);
}

}  // namespace rtpm::bench
