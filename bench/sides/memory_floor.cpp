#include "sides/memory_floor.hpp"

#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <ctime>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::bench {
namespace {

constexpr Duration kTimeout = std::chrono::seconds{1};
constexpr std::size_t kSlotCount = 1024;
constexpr std::size_t kSlotSize = 128;

/// The place where a thread sleeps. Aligned so that the slots behind it are, too.
struct alignas(kSlotSize) Bed {
  std::atomic<std::uint32_t> is_taken{0};
  std::atomic<std::uint32_t> wake_count{0};

  void wake() noexcept {
    if (is_taken.load(std::memory_order_seq_cst) == 0 || is_taken.exchange(0) == 0) return;
    wake_count.fetch_add(1);
    syscall(SYS_futex, &wake_count, FUTEX_WAKE, 1, nullptr, nullptr, 0);
  }
  /// Sleeps unless `has_work()`, for a second at most.
  template <class HasWork>
  void sleep(HasWork has_work) noexcept {
    const std::uint32_t before = wake_count.load();
    is_taken.store(1, std::memory_order_seq_cst);
    const timespec patience{.tv_sec = 1, .tv_nsec = 0};
    if (!has_work()) {
      syscall(SYS_futex, &wake_count, FUTEX_WAIT, before, &patience, nullptr, 0);
    }
    is_taken.store(0, std::memory_order_relaxed);
  }
};

/// How long a waiting side spins before it sleeps.
Duration spin_of(const rt::WaitConfig& wait, Duration give_up) noexcept {
  if (wait.strategy == rt::WaitStrategy::kBlock) return Duration{0};
  return wait.strategy == rt::WaitStrategy::kAdaptive ? wait.spin : give_up;
}

/// Spins until `has_work()`; false if it took longer than `spin`.
template <class HasWork>
bool spin_until(HasWork has_work, Duration spin) noexcept {
  constexpr int kLooksPerClock = 64;
  if (has_work()) return true;
  if (spin <= Duration{0}) return false;
  const MonotonicTime end = spin == Duration::max() ? kNever : rt::now() + spin;
  do {
    for (int look = 0; look < kLooksPerClock; ++look) {
      if (has_work()) return true;
    }
  } while (end == kNever || rt::now() < end);
  return false;
}

/// One direction of one caller's path: how many frames were written, and how many were read.
struct Counts {
  alignas(64) std::atomic<std::uint64_t> tail{0};
  alignas(64) std::atomic<std::uint64_t> head{0};
};

/// The head of a path. The slots of both directions follow.
struct PathHead {
  Counts to_server;
  Counts to_caller;
  Bed caller_bed;
};

/// The slots of one direction: as many as RTPM has, or one for frames of an unusual size.
struct Slots {
  explicit Slots(std::size_t frame_size) noexcept
      : count(frame_size == kFloorFrameSize ? kSlotCount : 1),
        size((frame_size + kSlotSize - 1) / kSlotSize * kSlotSize) {}
  std::size_t count;
  std::size_t size;
};

/// Spares the usual frame a call, as the compiler knows its size.
void copy_frame(std::byte* to, const std::byte* from, std::size_t size) noexcept {
  if (size == kFloorFrameSize) {
    std::memcpy(to, from, kFloorFrameSize);
  } else {
    std::memcpy(to, from, size);
  }
}

/// One process's view of one direction.
struct Ring {
  Counts& counts;
  std::byte* memory;
  std::size_t frame_size;
  Slots slots{frame_size};

  [[nodiscard]] std::byte* slot(std::uint64_t position) const noexcept {
    return memory + (position & (slots.count - 1)) * slots.size;
  }
  void push(const std::byte* frame, std::uint64_t position) const noexcept {
    copy_frame(slot(position), frame, frame_size);
    counts.tail.store(position + 1, std::memory_order_seq_cst);
  }
  [[nodiscard]] bool has(std::uint64_t position) const noexcept {
    return counts.tail.load(std::memory_order_seq_cst) != position;
  }
  void pop(std::byte* frame, std::uint64_t position) const noexcept {
    copy_frame(frame, slot(position), frame_size);
    counts.head.store(position + 1, std::memory_order_release);
  }
};

struct Path {
  Path(MutableBytes memory, std::size_t size)
      : head(*reinterpret_cast<PathHead*>(memory.data())),
        to_server{head.to_server, memory.data() + sizeof(PathHead), size},
        to_caller{head.to_caller, to_server.slot(0) + to_server.slots.count * to_server.slots.size,
                  size} {}
  PathHead& head;
  Ring to_server;
  Ring to_caller;
  std::uint64_t position = 0;
};

/// Makes a caller's exchange: one frame there and back.
struct MemoryExchange {
  Outcome<> operator()(const FloorFrame& sent, FloorFrame& received) {
    const auto has_reply = [this] { return path.to_caller.has(path.position); };
    path.to_server.push(sent.data(), path.position);
    lane_bed.wake();
    if (!spin_until(has_reply, spin_of(wait, kTimeout))) {
      // One sleep is not enough: a server that is stopped between its answer and the wake-up wakes
      // the next sleep instead.
      const MonotonicTime end = rt::now() + kTimeout;
      const bool may_sleep = wait.strategy != rt::WaitStrategy::kSpin;
      while (may_sleep && !has_reply() && rt::now() < end)
        path.head.caller_bed.sleep(has_reply);
      if (!has_reply()) return failure("the raw floor's server does not answer");
    }
    path.to_caller.pop(received.data(), path.position++);
    return {};
  }

  Path path;
  Bed& lane_bed;
  rt::WaitConfig wait;
};

void serve_lane(Bed& bed, std::vector<Path> paths, std::size_t size, const rt::WaitConfig& wait) {
  const auto has_work = [&paths] {
    return std::ranges::any_of(paths,
                               [](const Path& each) { return each.to_server.has(each.position); });
  };
  const Duration spin = spin_of(wait, Duration::max());
  for (FloorFrame frame(size);;) {
    for (Path& path : paths) {
      if (!path.to_server.has(path.position)) continue;
      path.to_server.pop(frame.data(), path.position);
      compute_as_asked(frame);
      path.to_caller.push(frame.data(), path.position++);
      path.head.caller_bed.wake();
    }
    if (!spin_until(has_work, spin)) bed.sleep(has_work);
  }
}

}  // namespace

MemoryFloor::MemoryFloor(const std::vector<int>& caller_counts, std::size_t payload_size)
    : frame_size_(floor_frame_size(Carrier::kSharedMemory, payload_size)) {
  const Slots slots(frame_size_);
  const std::size_t path_size = sizeof(PathHead) + 2 * slots.count * slots.size;
  for (const int count : caller_counts)
    size_ += sizeof(Bed) + static_cast<std::size_t>(count) * path_size;
  // Fresh memory is zero, which is the initial state of beds and counts.
  void* const memory =
      mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return;
  auto* next = memory_ = static_cast<std::byte*>(memory);
  for (const int count : caller_counts) {
    Lane& lane = lanes_.emplace_back(Lane{.bed = next});
    next += sizeof(Bed);
    for (int i = 0; i < count; ++i, next += path_size)
      lane.paths.emplace_back(next, path_size);
  }
}

Outcome<std::unique_ptr<MemoryFloor>> MemoryFloor::create(const std::vector<int>& caller_counts,
                                                          std::size_t payload_size) {
  std::unique_ptr<MemoryFloor> floor(new MemoryFloor(caller_counts, payload_size));
  if (floor->memory_ == nullptr) return failure("no memory for the raw floor");
  return floor;
}

MemoryFloor::~MemoryFloor() {
  if (memory_ != nullptr) munmap(memory_, size_);
}

Outcome<> MemoryFloor::serve(const std::vector<FloorLaneConfig>& lanes, rt::RealtimeMode realtime) {
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const Lane& lane = lanes_[i];
    // Maps all pages before the first call.
    for (const MutableBytes path : lane.paths)
      rt::prefault(path);
    auto started = start_floor_thread(lanes[i], realtime, [&lane, wait = lanes[i].wait, this] {
      std::vector<Path> paths;
      for (const MutableBytes path : lane.paths)
        paths.emplace_back(path, frame_size_);
      serve_lane(*reinterpret_cast<Bed*>(lane.bed), std::move(paths), frame_size_, wait);
    });
    if (!started) return started;
  }
  return outcome(rt::lock_memory(realtime));
}

Call MemoryFloor::connect(std::size_t lane, const rt::WaitConfig& wait) {
  Lane& its_lane = lanes_[lane];
  const MutableBytes path = its_lane.paths.at(its_lane.connected_count++);
  // Here, too: the first thousand calls use slots that this process has not touched.
  rt::prefault(path);
  Bed& bed = *reinterpret_cast<Bed*>(its_lane.bed);
  return make_floor_caller(frame_size_, MemoryExchange{{path, frame_size_}, bed, wait});
}

}  // namespace rtpm::bench
