#include "sides/memory_floor.hpp"

#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <ctime>
#include <type_traits>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::bench {
namespace {

constexpr Duration kTimeout = std::chrono::seconds{1};
constexpr std::size_t kSlotCount = 1024;
constexpr std::size_t kSlotSize = 128;
/// A size that the compiler knows, so that it copies the usual frame without a call.
using UsualSize = std::integral_constant<std::size_t, kFloorFrameSize>;

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

std::size_t slots_size(std::size_t frame_size) {
  if (frame_size == UsualSize()) return kSlotCount * kSlotSize;
  return (frame_size + kSlotSize - 1) / kSlotSize * kSlotSize;
}

/// One process's view of one direction.
template <class Size>
struct Ring {
  Counts& counts;
  std::byte* slots;
  Size size;

  [[nodiscard]] std::byte* slot(std::uint64_t position) const noexcept {
    if constexpr (std::is_same_v<Size, std::size_t>) return slots;
    return slots + position % kSlotCount * kSlotSize;
  }
  void push(const std::byte* frame, std::uint64_t position) const noexcept {
    std::memcpy(slot(position), frame, size);
    counts.tail.store(position + 1, std::memory_order_seq_cst);
  }
  [[nodiscard]] bool has(std::uint64_t position) const noexcept {
    return counts.tail.load(std::memory_order_seq_cst) != position;
  }
  void pop(std::byte* frame, std::uint64_t position) const noexcept {
    std::memcpy(frame, slot(position), size);
    counts.head.store(position + 1, std::memory_order_release);
  }
};

template <class Size>
struct Path {
  Path(MutableBytes memory, Size size)
      : head(*reinterpret_cast<PathHead*>(memory.data())),
        to_server{head.to_server, memory.data() + sizeof(PathHead), size},
        to_caller{head.to_caller, to_server.slots + slots_size(size), size} {}
  PathHead& head;
  Ring<Size> to_server;
  Ring<Size> to_caller;
  std::uint64_t position = 0;
};

/// Makes a caller's exchange: one frame there and back.
template <class Size>
struct MemoryExchange {
  expected<void, std::string> operator()(const FloorFrame& sent, FloorFrame& received) {
    const auto has_reply = [this] { return path.to_caller.has(path.position); };
    path.to_server.push(sent.data(), path.position);
    lane_bed.wake();
    if (!spin_until(has_reply, spin_of(wait, kTimeout)) && !sleep_until(has_reply)) {
      return unexpected{std::string("the raw floor's server does not answer")};
    }
    path.to_caller.pop(received.data(), path.position++);
    return {};
  }

  /// One sleep is not enough: a server that is stopped between its answer and the wake-up wakes the
  /// next sleep instead.
  template <class HasReply>
  bool sleep_until(HasReply has_reply) noexcept {
    const MonotonicTime end = rt::now() + kTimeout;
    const bool may_sleep = wait.strategy != rt::WaitStrategy::kSpin;
    while (may_sleep && !has_reply() && rt::now() < end)
      path.head.caller_bed.sleep(has_reply);
    return has_reply();
  }

  Path<Size> path;
  Bed& lane_bed;
  rt::WaitConfig wait;
};

template <class Size>
void serve_lane(Bed& bed, std::vector<Path<Size>> paths, Size size, const rt::WaitConfig& wait) {
  const auto has_work = [&paths] {
    for (const auto& path : paths) {
      if (path.to_server.has(path.position)) return true;
    }
    return false;
  };
  const Duration spin = spin_of(wait, Duration::max());
  for (FloorFrame frame(size);;) {
    for (auto& path : paths) {
      if (!path.to_server.has(path.position)) continue;
      path.to_server.pop(frame.data(), path.position);
      compute_as_asked(frame);
      path.to_caller.push(frame.data(), path.position++);
      path.head.caller_bed.wake();
    }
    if (!spin_until(has_work, spin)) bed.sleep(has_work);
  }
}

/// Calls `body` with the frame's size, as a compile-time constant if it is the usual one.
template <class Body>
auto with_size(std::size_t frame_size, Body body) {
  return frame_size == UsualSize() ? body(UsualSize()) : body(frame_size);
}

}  // namespace

MemoryFloor::MemoryFloor(const std::vector<int>& caller_counts, std::size_t payload_size)
    : frame_size_(floor_frame_size(Carrier::kSharedMemory, payload_size)) {
  const std::size_t path_size = sizeof(PathHead) + 2 * slots_size(frame_size_);
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

expected<std::unique_ptr<MemoryFloor>, std::string> MemoryFloor::create(
    const std::vector<int>& caller_counts, std::size_t payload_size) {
  std::unique_ptr<MemoryFloor> floor(new MemoryFloor(caller_counts, payload_size));
  if (floor->memory_ == nullptr) return unexpected{std::string("no memory for the raw floor")};
  return floor;
}

MemoryFloor::~MemoryFloor() {
  if (memory_ != nullptr) munmap(memory_, size_);
}

expected<void, std::string> MemoryFloor::serve(const std::vector<FloorLaneConfig>& lanes,
                                               rt::RealtimeMode realtime) {
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    const Lane& lane = lanes_[i];
    // Maps all pages before the first call.
    for (const MutableBytes path : lane.paths)
      rt::prefault(path);
    auto started = start_floor_thread(lanes[i], realtime, [&lane, wait = lanes[i].wait, this] {
      with_size(frame_size_, [&]<class Size>(Size size) {
        std::vector<Path<Size>> paths;
        for (const MutableBytes path : lane.paths)
          paths.emplace_back(path, size);
        serve_lane(*reinterpret_cast<Bed*>(lane.bed), std::move(paths), size, wait);
      });
    });
    if (!started) return started;
  }
  if (auto locked = rt::lock_memory(realtime); !locked) return unexpected{locked.error().text()};
  return {};
}

std::unique_ptr<Caller> MemoryFloor::connect(std::size_t lane, const rt::WaitConfig& wait) {
  Lane& its_lane = lanes_[lane];
  const MutableBytes path = its_lane.paths.at(its_lane.connected_count++);
  // Here, too: the first thousand calls use slots that this process has not touched.
  rt::prefault(path);
  Bed& bed = *reinterpret_cast<Bed*>(its_lane.bed);
  return with_size(frame_size_, [&]<class Size>(Size size) {
    return make_floor_caller(size, MemoryExchange<Size>{{path, size}, bed, wait});
  });
}

}  // namespace rtpm::bench
