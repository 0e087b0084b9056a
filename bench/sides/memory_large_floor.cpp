#include "sides/memory_large_floor.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/rt/memory.hpp"
#include "sides/memory_wait.hpp"

namespace rtpm::bench {
namespace {

constexpr Duration kTimeout = std::chrono::seconds{1};

/// One direction: how many frames were put in, and the last of them.
struct Direction {
  alignas(64) std::atomic<std::uint64_t> count{0};
  Bed reader_bed;
};

}  // namespace

struct MemoryLargeFloor::Layout {
  Direction to_server;
  Direction to_caller;
  // Behind it the two buffers.
  [[nodiscard]] MutableBytes buffer(int direction, std::size_t frame_size) {
    return {
        reinterpret_cast<std::byte*>(this + 1) + static_cast<std::size_t>(direction) * frame_size,
        frame_size};
  }
};

namespace {

/// Copies a frame in and says so.
void put(Direction& direction, MutableBytes buffer, ConstBytes frame) noexcept {
  std::memcpy(buffer.data(), frame.data(), frame.size());
  direction.count.fetch_add(1, std::memory_order_seq_cst);
  direction.reader_bed.wake();
}

/// Waits until more than `seen` frames were put in.
bool await(Direction& direction, std::uint64_t seen, Duration spin, bool may_sleep) noexcept {
  const auto has_more = [&] { return direction.count.load(std::memory_order_seq_cst) != seen; };
  if (spin_until(has_more, spin)) return true;
  return may_sleep ? direction.reader_bed.sleep_until(has_more) : has_more();
}

class LargeCaller final : public Caller {
 public:
  LargeCaller(Direction& to_server, Direction& to_caller, MutableBytes out, MutableBytes in,
              const rt::WaitConfig& wait)
      : to_server_(to_server),
        to_caller_(to_caller),
        out_(out),
        in_(in),
        spin_(spin_of(wait, kTimeout)),
        may_sleep_(wait.strategy != rt::WaitStrategy::kSpin),
        sent_(out.size()),
        received_(in.size()) {
    for (std::size_t i = wire::kHeaderSize; i < sent_.size(); ++i)
      sent_[i] = static_cast<std::byte>(i);
  }

  expected<void, std::string> echo() override {
    put(to_server_, out_, sent_);
    if (!await(to_caller_, seen_, spin_, may_sleep_)) {
      return unexpected{std::string("the raw floor's server does not answer")};
    }
    ++seen_;
    std::memcpy(received_.data(), in_.data(), in_.size());
    if (!are_same(received_, sent_)) return unexpected{std::string("the raw floor's echo differs")};
    return {};
  }

  expected<void, std::string> work(Duration) override {
    return unexpected{std::string("this raw floor only echoes")};
  }

 private:
  Direction& to_server_;
  Direction& to_caller_;
  MutableBytes out_;
  MutableBytes in_;
  Duration spin_;
  bool may_sleep_;
  std::uint64_t seen_ = 0;
  std::vector<std::byte> sent_;
  std::vector<std::byte> received_;
};

void serve_large(Direction& to_server, Direction& to_caller, MutableBytes in, MutableBytes out,
                 const rt::WaitConfig& wait) {
  const Duration spin = spin_of(wait, Duration::max());
  std::vector<std::byte> frame(in.size());
  for (std::uint64_t seen = 0;;) {
    if (!await(to_server, seen, spin, true)) continue;
    ++seen;
    std::memcpy(frame.data(), in.data(), in.size());
    put(to_caller, out, frame);
  }
}

}  // namespace

expected<std::unique_ptr<MemoryLargeFloor>, std::string> MemoryLargeFloor::create(
    std::size_t payload_size) {
  const std::size_t frame_size = floor_frame_size(Carrier::kSharedMemory, payload_size);
  const std::size_t size = sizeof(Layout) + 2 * frame_size;
  void* const memory =
      mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return unexpected{std::string("no memory for the raw floor")};
  // Touched, so that the first call meets no page fault.
  std::memset(memory, 0, size);
  return std::unique_ptr<MemoryLargeFloor>(
      new MemoryLargeFloor(new (memory) Layout, frame_size, size));
}

MemoryLargeFloor::~MemoryLargeFloor() {
  munmap(layout_, size_);
}

expected<void, std::string> MemoryLargeFloor::serve(const FloorLaneConfig& lane,
                                                    rt::RealtimeMode realtime) {
  auto thread = rt::Thread::start(
      {.name = lane.name, .priority = lane.priority, .cpus = {lane.cpu}, .realtime = realtime},
      [this, wait = lane.wait] {
        serve_large(layout_->to_server, layout_->to_caller, layout_->buffer(0, frame_size_),
                    layout_->buffer(1, frame_size_), wait);
      });
  if (!thread) return unexpected{thread.error().text()};
  // It serves until the process ends.
  static_cast<void>(new rt::Thread(std::move(*thread)));
  if (auto locked = rt::lock_memory(realtime); !locked) return unexpected{locked.error().text()};
  return {};
}

std::unique_ptr<Caller> MemoryLargeFloor::connect(const rt::WaitConfig& wait) {
  return std::make_unique<LargeCaller>(layout_->to_server, layout_->to_caller,
                                       layout_->buffer(0, frame_size_),
                                       layout_->buffer(1, frame_size_), wait);
}

}  // namespace rtpm::bench
