#include "os/library.hpp"

#include <dlfcn.h>
#include <link.h>

#include <algorithm>
#include <cstdint>
#include <span>

namespace rtpm::driver_host {
namespace {

struct Search {
  std::uintptr_t symbol = 0;
  std::uintptr_t begin = 0;  ///< First address of the object around the symbol.
  std::uintptr_t end = 0;
};

int look_at(dl_phdr_info* object, std::size_t, void* search_data) {
  auto& search = *static_cast<Search*>(search_data);
  std::uintptr_t begin = UINTPTR_MAX;
  std::uintptr_t end = 0;
  for (const auto& segment : std::span(object->dlpi_phdr, object->dlpi_phnum)) {
    if (segment.p_type != PT_LOAD) continue;
    begin = std::min(begin, object->dlpi_addr + segment.p_vaddr);
    end = std::max(end, object->dlpi_addr + segment.p_vaddr + segment.p_memsz);
  }
  if (search.symbol < begin || search.symbol >= end) return 0;
  search.begin = begin;
  search.end = end;
  return 1;
}

}  // namespace

expected<std::shared_ptr<Library>, std::string> Library::load(const std::string& file) {
  // dlopen() would search for a bare name among the system's libraries.
  const std::string path = file.find('/') == std::string::npos ? "./" + file : file;
  void* const handle = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) return unexpected{std::string(::dlerror())};
  return std::make_shared<Library>(handle, file);
}

Library::~Library() {
  ::dlclose(handle_);
}

const void* Library::symbol(const char* name) const noexcept {
  return ::dlsym(handle_, name);
}

void Library::name_code_around(const void* symbol) {
  Search search{.symbol = reinterpret_cast<std::uintptr_t>(symbol)};
  if (::dl_iterate_phdr(&look_at, &search) == 0) return;
  code_name_.emplace(reinterpret_cast<const void*>(search.begin), search.end - search.begin,
                     name_.c_str());
}

}  // namespace rtpm::driver_host
