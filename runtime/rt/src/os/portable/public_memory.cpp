#include "rtpm/rt/public_memory.hpp"

#include <sys/mman.h>

#include <cerrno>
#include <utility>

#include "rtpm/rt/memory.hpp"

// No other process can find the memory here, which is therefore private.
namespace rtpm::rt {
namespace {

void unmap(ConstBytes bytes) noexcept {
  if (!bytes.empty()) munmap(const_cast<std::byte*>(bytes.data()), bytes.size());
}

}  // namespace

expected<PublicMemory, SetupError> PublicMemory::create(std::string_view name, std::size_t size) {
  void* const begin =
      mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (begin == MAP_FAILED) {
    return setup_error("memory 'rtpm-" + std::string(name) + "' can't be made", system_error(errno),
                       "raise the limit of memory");
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
  unmap(bytes_);
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

PublicView::~PublicView() {
  unmap(bytes_);
}

bool PublicView::is_alive() const noexcept {
  return false;
}

std::vector<PublicView> find_public_memory(std::string_view, std::size_t) {
  return {};
}

}  // namespace rtpm::rt
