#include "rtpm/rt/lazy_memory.hpp"

#include <windows.h>

#include <algorithm>
#include <cstdint>
#include <utility>

#include "module.hpp"

// Memory is reserved, and committed in steps when a thread touches it. Committed at once, the large
// buffers of a server would charge gigabytes to the system's limit.
namespace rtpm::rt {
namespace {

constexpr std::size_t kPageSize = 4096;
constexpr std::size_t kStep = std::size_t{64} * 1024;
constexpr std::uintptr_t kMark = 0x5274'704d'4c61'7a79;

/// The first page of each reservation, by which the handler below recognises it.
struct Mark {
  std::uintptr_t value;
};
std::uintptr_t mark_of(const void* begin) noexcept {
  return reinterpret_cast<std::uintptr_t>(begin) ^ kMark;
}

std::byte* reservation_of(MutableBytes bytes) noexcept {
  return bytes.data() - kPageSize;
}

bool is_lazy(const MEMORY_BASIC_INFORMATION& page) noexcept {
  if (page.Type != MEM_PRIVATE || page.AllocationProtect != PAGE_READWRITE) return false;
  MEMORY_BASIC_INFORMATION first{};
  if (VirtualQuery(page.AllocationBase, &first, sizeof first) == 0 || first.State != MEM_COMMIT ||
      first.Protect != PAGE_READWRITE) {
    return false;
  }
  return static_cast<const Mark*>(page.AllocationBase)->value == mark_of(page.AllocationBase);
}

/// Commits the step of the reservation that `address` is in.
bool commit_around(std::uintptr_t address, const MEMORY_BASIC_INFORMATION& page) noexcept {
  const auto end = reinterpret_cast<std::uintptr_t>(page.BaseAddress) + page.RegionSize;
  const std::uintptr_t first = address / kStep * kStep;
  const std::uintptr_t begin = std::max(first, reinterpret_cast<std::uintptr_t>(page.BaseAddress));
  const std::uintptr_t size = std::min(first + kStep, end) - begin;
  return VirtualAlloc(reinterpret_cast<void*>(begin), size, MEM_COMMIT, PAGE_READWRITE) != nullptr;
}

LONG WINAPI commit_touched(EXCEPTION_POINTERS* exception) noexcept {
  const EXCEPTION_RECORD& record = *exception->ExceptionRecord;
  constexpr ULONG_PTR kExecuted = 8;
  if (record.ExceptionCode != EXCEPTION_ACCESS_VIOLATION || record.NumberParameters < 2 ||
      record.ExceptionInformation[0] == kExecuted) {
    return EXCEPTION_CONTINUE_SEARCH;
  }
  const std::uintptr_t address = record.ExceptionInformation[1];
  MEMORY_BASIC_INFORMATION page{};
  if (VirtualQuery(reinterpret_cast<const void*>(address), &page, sizeof page) == 0 ||
      page.State == MEM_FREE || !is_lazy(page)) {
    return EXCEPTION_CONTINUE_SEARCH;
  }
  // If another thread has just committed the page, the access is repeated as well.
  const bool is_there = page.State == MEM_COMMIT || commit_around(address, page);
  return is_there ? EXCEPTION_CONTINUE_EXECUTION : EXCEPTION_CONTINUE_SEARCH;
}

bool has_handler() noexcept {
  static const bool has = [] {
    os::keep_loaded(reinterpret_cast<const void*>(&commit_touched));
    return AddVectoredExceptionHandler(/*First=*/1, &commit_touched) != nullptr;
  }();
  return has;
}

}  // namespace

LazyMemory::LazyMemory(std::size_t size) noexcept {
  if (size == 0 || size > SIZE_MAX - kPageSize || !has_handler()) return;
  void* const begin = VirtualAlloc(nullptr, kPageSize + size, MEM_RESERVE, PAGE_READWRITE);
  if (begin == nullptr) return;
  // The system writes to memory that is committed, and faults on no other.
  const std::size_t first = kPageSize + std::min(size, kFirstSize);
  if (VirtualAlloc(begin, first, MEM_COMMIT, PAGE_READWRITE) == nullptr) {
    VirtualFree(begin, 0, MEM_RELEASE);
    return;
  }
  static_cast<Mark*>(begin)->value = mark_of(begin);
  bytes_ = {static_cast<std::byte*>(begin) + kPageSize, size};
}

LazyMemory::LazyMemory(LazyMemory&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}

LazyMemory& LazyMemory::operator=(LazyMemory&& other) noexcept {
  std::swap(bytes_, other.bytes_);
  return *this;
}

LazyMemory::~LazyMemory() {
  if (!bytes_.empty()) VirtualFree(reservation_of(bytes_), 0, MEM_RELEASE);
}

}  // namespace rtpm::rt
