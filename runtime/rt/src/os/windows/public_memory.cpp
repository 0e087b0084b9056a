#include "rtpm/rt/public_memory.hpp"

#include <windows.h>

#include <utility>

#include "rtpm/rt/memory.hpp"

// No other process can find the memory here, which is therefore private.
namespace rtpm::rt {

expected<PublicMemory, SetupError> PublicMemory::create(std::string_view name, std::size_t size) {
  void* const begin = VirtualAlloc(nullptr, size, MEM_RESERVE | MEM_COMMIT, PAGE_READWRITE);
  if (begin == nullptr) {
    return setup_error("memory 'rtpm-" + std::string(name) + "' can't be made",
                       std::error_code(static_cast<int>(GetLastError()), std::system_category()),
                       "end other programs, or enlarge the paging file");
  }
  PublicMemory memory;
  memory.bytes_ = {static_cast<std::byte*>(begin), size};
  prefault(memory.bytes_);
  return memory;
}

PublicMemory::PublicMemory(PublicMemory&& other) noexcept
    : file_(std::exchange(other.file_, -1)), bytes_(std::exchange(other.bytes_, {})) {}

PublicMemory& PublicMemory::operator=(PublicMemory&& other) noexcept {
  std::swap(file_, other.file_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

PublicMemory::~PublicMemory() {
  if (!bytes_.empty()) VirtualFree(bytes_.data(), 0, MEM_RELEASE);
}

PublicView::PublicView(PublicView&& other) noexcept
    : process_id_(other.process_id_),
      process_folder_(std::exchange(other.process_folder_, -1)),
      bytes_(std::exchange(other.bytes_, {})) {}

PublicView& PublicView::operator=(PublicView&& other) noexcept {
  std::swap(process_id_, other.process_id_);
  std::swap(process_folder_, other.process_folder_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

// Views come from find_public_memory() only, which finds none.
PublicView::~PublicView() = default;

bool PublicView::is_alive() const noexcept {
  return false;
}

std::vector<PublicView> find_public_memory(std::string_view, std::size_t) {
  return {};
}

}  // namespace rtpm::rt
