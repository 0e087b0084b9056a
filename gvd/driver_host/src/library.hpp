#pragma once

#include <dlfcn.h>

namespace rtpm::driver_host {

/// A loaded shared library; unloads it at its end.
/// @threads  any
class Library {
 public:
  explicit Library(void* handle) noexcept : handle_(handle) {}
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  ~Library() { dlclose(handle_); }

  /// Null: it exports none of that name.
  [[nodiscard]] void* symbol(const char* name) const noexcept { return dlsym(handle_, name); }

 private:
  void* handle_;
};

}  // namespace rtpm::driver_host
