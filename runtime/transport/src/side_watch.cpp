#include "side_watch.hpp"

#include <linux/io_uring.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>

#include "rtpm/base/assert.hpp"

namespace rtpm::transport {
namespace {

// Room for a begin or an end at a time; the kernel makes that for completions twice as large.
constexpr std::uint32_t kEntryCount = 8;
// IORING_SETUP_COOP_TASKRUN, of which headers before Linux 5.19 don't know: the kernel doesn't
// interrupt the thread while it runs. That isn't needed, as each system call notices.
constexpr std::uint32_t kCooperative = 1U << 8;
// Of what nobody asks about.
constexpr std::uint64_t kNoTag = 0;

// The C library has no functions for these.
Descriptor set_up(io_uring_params& parameters) noexcept {
  return Descriptor(static_cast<int>(syscall(SYS_io_uring_setup, kEntryCount, &parameters)));
}

std::span<std::byte> map_shared(const Descriptor& ring, std::size_t size, off_t offset) noexcept {
  void* const place =
      mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, ring.number(), offset);
  if (place == MAP_FAILED) return {};
  return {static_cast<std::byte*>(place), size};
}

template <class T>
T* at(std::span<std::byte> memory, std::uint32_t offset) noexcept {
  return reinterpret_cast<T*>(memory.data() + offset);
}

}  // namespace

std::unique_ptr<SideWatch> SideWatch::open() {
  auto watch = std::make_unique<SideWatch>();
  io_uring_params layout{};
  layout.flags = kCooperative;
  watch->ring_ = set_up(layout);
  if (!watch->is_open()) {
    layout = {};
    watch->ring_ = set_up(layout);
  }
  if (!watch->is_open() || !watch->map(layout)) return nullptr;
  return watch;
}

bool SideWatch::map(const io_uring_params& layout) noexcept {
  if ((layout.features & IORING_FEAT_SINGLE_MMAP) == 0) return false;
  const std::size_t submission_size =
      layout.sq_off.array + layout.sq_entries * sizeof(std::uint32_t);
  const std::size_t completion_size = layout.cq_off.cqes + layout.cq_entries * sizeof(io_uring_cqe);
  ring_memory_ = map_shared(ring_, std::max(submission_size, completion_size), IORING_OFF_SQ_RING);
  entry_memory_ = map_shared(ring_, layout.sq_entries * sizeof(io_uring_sqe), IORING_OFF_SQES);
  if (ring_memory_.empty() || entry_memory_.empty()) return false;
  submitted_ = {at<std::uint32_t>(ring_memory_, layout.sq_off.head),
                at<std::uint32_t>(ring_memory_, layout.sq_off.tail),
                *at<std::uint32_t>(ring_memory_, layout.sq_off.ring_mask)};
  completed_ = {at<std::uint32_t>(ring_memory_, layout.cq_off.head),
                at<std::uint32_t>(ring_memory_, layout.cq_off.tail),
                *at<std::uint32_t>(ring_memory_, layout.cq_off.ring_mask)};
  entries_ = at<io_uring_sqe>(entry_memory_, 0);
  completions_ = at<io_uring_cqe>(ring_memory_, layout.cq_off.cqes);
  // Each place of the ring has the entry of its own number, for good.
  auto* const places = at<std::uint32_t>(ring_memory_, layout.sq_off.array);
  for (std::uint32_t i = 0; i < layout.sq_entries; ++i)
    places[i] = i;
  return true;
}

SideWatch::~SideWatch() {
  for (const std::span<std::byte> memory : {ring_memory_, entry_memory_}) {
    if (!memory.empty()) munmap(memory.data(), memory.size());
  }
}

bool SideWatch::begin(std::span<const int> descriptors) noexcept {
  RTPM_ASSERT(is_open() && !is_on_ && descriptors.size() <= kCountMax, "begun once, for a few");
  // What is left of the watch before says nothing about this one.
  static_cast<void>(has_news());
  ++watch_count_;
  has_news_ = false;
  descriptor_count_ = descriptors.size();
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    io_uring_sqe& entry = next_entry();
    entry.opcode = IORING_OP_POLL_ADD;
    entry.fd = descriptors[i];
    entry.poll32_events = POLLIN;
    entry.user_data = tag_of(i);
  }
  is_on_ = submit(static_cast<std::uint32_t>(descriptors.size()));
  return is_on_;
}

bool SideWatch::has_news() noexcept {
  std::uint32_t head = *completed_.head;
  // What the kernel wrote before it moved the tail is there.
  const std::uint32_t tail =
      std::atomic_ref<std::uint32_t>(*completed_.tail).load(std::memory_order_acquire);
  if (head == tail) return has_news_;
  for (; head != tail; ++head) {
    const io_uring_cqe& completion = completions_[head & completed_.mask];
    if (completion.user_data >= tag_of(0) && completion.res != -ECANCELED) has_news_ = true;
  }
  std::atomic_ref<std::uint32_t>(*completed_.head).store(head, std::memory_order_release);
  return has_news_;
}

void SideWatch::end() noexcept {
  if (!is_on_) return;
  is_on_ = false;
  for (std::size_t i = 0; i < descriptor_count_; ++i) {
    io_uring_sqe& entry = next_entry();
    entry.opcode = IORING_OP_POLL_REMOVE;
    entry.addr = tag_of(i);
    entry.user_data = kNoTag;
  }
  static_cast<void>(submit(static_cast<std::uint32_t>(descriptor_count_)));
}

// The next place for an order, cleared; submit() hands it over.
io_uring_sqe& SideWatch::next_entry() noexcept {
  const std::uint32_t tail = *submitted_.tail;
  io_uring_sqe& entry = entries_[tail & submitted_.mask];
  entry = {};
  std::atomic_ref<std::uint32_t>(*submitted_.tail).store(tail + 1, std::memory_order_release);
  return entry;
}

bool SideWatch::submit(std::uint32_t count) noexcept {
  const long taken = syscall(SYS_io_uring_enter, ring_.number(), count, 0, 0, nullptr, 0);
  if (taken == static_cast<long>(count)) return true;
  // Without the ring nothing is watched.
  ring_ = Descriptor{};
  is_on_ = false;
  return false;
}

}  // namespace rtpm::transport
