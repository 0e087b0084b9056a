#include "recording_vfs.hpp"

#include <sqlite3.h>

#include <algorithm>
#include <new>

namespace rtpm::file_store {
namespace {

using Kind = FileOperation::Kind;

/// SQLite's file, which wraps the system's own file.
struct RecordedFile {
  sqlite3_file base;
  RecordingVfs* vfs;
  std::string* path;
  [[nodiscard]] sqlite3_file* real() { return reinterpret_cast<sqlite3_file*>(this + 1); }
};
RecordedFile& recorded(sqlite3_file* file) {
  return *reinterpret_cast<RecordedFile*>(file);
}
sqlite3_file* real(sqlite3_file* file) {
  return recorded(file).real();
}

int close(sqlite3_file* file) {
  delete recorded(file).path;
  return real(file)->pMethods == nullptr ? SQLITE_OK : real(file)->pMethods->xClose(real(file));
}
int read(sqlite3_file* file, void* to, int size, sqlite3_int64 offset) {
  return real(file)->pMethods->xRead(real(file), to, size, offset);
}
int write(sqlite3_file* file, const void* from, int size, sqlite3_int64 offset) {
  RecordedFile& self = recorded(file);
  if (self.vfs->is_full()) return SQLITE_FULL;
  self.vfs->add({Kind::kWrite, *self.path, static_cast<std::uint64_t>(offset),
                 std::string(static_cast<const char*>(from), static_cast<std::size_t>(size))});
  return real(file)->pMethods->xWrite(real(file), from, size, offset);
}
int truncate(sqlite3_file* file, sqlite3_int64 size) {
  RecordedFile& self = recorded(file);
  self.vfs->add({Kind::kTruncate, *self.path, static_cast<std::uint64_t>(size), {}});
  return real(file)->pMethods->xTruncate(real(file), size);
}
// Skips the system's own sync: only the log determines what survives a power cut.
int sync(sqlite3_file* file, int) {
  RecordedFile& self = recorded(file);
  self.vfs->add({Kind::kSync, *self.path, 0, {}});
  return SQLITE_OK;
}
int file_size(sqlite3_file* file, sqlite3_int64* size) {
  return real(file)->pMethods->xFileSize(real(file), size);
}
int lock(sqlite3_file* file, int level) {
  return real(file)->pMethods->xLock(real(file), level);
}
int unlock(sqlite3_file* file, int level) {
  return real(file)->pMethods->xUnlock(real(file), level);
}
int check_reserved_lock(sqlite3_file* file, int* result) {
  return real(file)->pMethods->xCheckReservedLock(real(file), result);
}
int file_control(sqlite3_file* file, int operation, void* argument) {
  return real(file)->pMethods->xFileControl(real(file), operation, argument);
}
int sector_size(sqlite3_file* file) {
  return real(file)->pMethods->xSectorSize(real(file));
}
int device_characteristics(sqlite3_file* file) {
  return real(file)->pMethods->xDeviceCharacteristics(real(file));
}

// Version 1 has no shared memory; a database that only one program opens needs none.
const sqlite3_io_methods kMethods{.iVersion = 1,
                                  .xClose = close,
                                  .xRead = read,
                                  .xWrite = write,
                                  .xTruncate = truncate,
                                  .xSync = sync,
                                  .xFileSize = file_size,
                                  .xLock = lock,
                                  .xUnlock = unlock,
                                  .xCheckReservedLock = check_reserved_lock,
                                  .xFileControl = file_control,
                                  .xSectorSize = sector_size,
                                  .xDeviceCharacteristics = device_characteristics,
                                  .xShmMap = nullptr,
                                  .xShmLock = nullptr,
                                  .xShmBarrier = nullptr,
                                  .xShmUnmap = nullptr,
                                  .xFetch = nullptr,
                                  .xUnfetch = nullptr};

int open(sqlite3_vfs* vfs, const char* path, sqlite3_file* file, int flags, int* out_flags) {
  auto* const self = static_cast<RecordingVfs*>(vfs->pAppData);
  RecordedFile& made = recorded(file);
  made.base.pMethods = nullptr;
  made.real()->pMethods = nullptr;
  sqlite3_vfs* const system = sqlite3_vfs_find(nullptr);
  const int result = system->xOpen(system, path, made.real(), flags, out_flags);
  if (result != SQLITE_OK) return result;
  made.vfs = self;
  made.path = new std::string(path == nullptr ? "" : path);
  made.base.pMethods = &kMethods;
  return SQLITE_OK;
}

int delete_file(sqlite3_vfs* vfs, const char* path, int is_synced) {
  auto* const self = static_cast<RecordingVfs*>(vfs->pAppData);
  // After the folder's own sync the deletion survives a power cut.
  self->add({Kind::kDelete, path, is_synced != 0 ? std::uint64_t{1} : std::uint64_t{0}, {}});
  sqlite3_vfs* const system = sqlite3_vfs_find(nullptr);
  return system->xDelete(system, path, is_synced);
}

}  // namespace

struct RecordingVfs::Registered {
  sqlite3_vfs vfs{};
};

RecordingVfs::RecordingVfs(std::string name)
    : name_(std::move(name)), registered_(std::make_unique<Registered>()) {
  sqlite3_vfs& vfs = registered_->vfs;
  vfs = *sqlite3_vfs_find(nullptr);
  vfs.szOsFile += static_cast<int>(sizeof(RecordedFile));
  vfs.zName = name_.c_str();
  vfs.pNext = nullptr;
  vfs.pAppData = this;
  vfs.xOpen = open;
  vfs.xDelete = delete_file;
  sqlite3_vfs_register(&vfs, /*makeDflt=*/0);
}

RecordingVfs::~RecordingVfs() {
  sqlite3_vfs_unregister(&registered_->vfs);
}

void DiskImage::apply(const FileOperation& operation) {
  if (operation.kind == Kind::kMark) return;
  const auto is_of_file = [&](const FileOperation& each) { return each.path == operation.path; };
  if (operation.kind == Kind::kDelete && operation.offset == 1) {
    std::erase_if(pending_, is_of_file);
    synced_.erase(operation.path);
    return;
  }
  if (operation.kind != Kind::kSync) {
    pending_.push_back(operation);
    return;
  }
  for (const FileOperation& each : pending_) {
    if (is_of_file(each)) apply_to(synced_, each);
  }
  std::erase_if(pending_, is_of_file);
}

void DiskImage::apply_to(Files& files, const FileOperation& operation) {
  std::string& file = files[operation.path];
  switch (operation.kind) {
    case Kind::kWrite:
      file.resize(std::max<std::size_t>(file.size(), operation.offset + operation.bytes.size()));
      file.replace(operation.offset, operation.bytes.size(), operation.bytes);
      break;
    case Kind::kTruncate:
      file.resize(operation.offset);
      break;
    case Kind::kDelete:
      files.erase(operation.path);
      break;
    default:
      break;
  }
}

}  // namespace rtpm::file_store
