#include "rtpm/rt/public_memory.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <utility>

namespace rtpm::rt {
namespace {

void release(ConstBytes bytes, int file) noexcept {
  if (!bytes.empty()) munmap(const_cast<std::byte*>(bytes.data()), bytes.size());
  if (file >= 0) close(file);
}

}  // namespace

PublicMemory::PublicMemory(PublicMemory&& other) noexcept
    : file_(std::exchange(other.file_, -1)), bytes_(std::exchange(other.bytes_, {})) {}

PublicMemory& PublicMemory::operator=(PublicMemory&& other) noexcept {
  std::swap(file_, other.file_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

PublicMemory::~PublicMemory() {
  release(bytes_, file_);
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
  release(bytes_, process_folder_);
}

}  // namespace rtpm::rt
