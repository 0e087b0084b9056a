#include "os/process.hpp"

#include <fcntl.h>
#include <io.h>
#include <windows.h>

#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>

namespace rtpm::program::os {
namespace {

constexpr std::size_t kPathSizeMax = 1024;

bool has_memory() noexcept {
  constexpr std::size_t kLittle = 4096;
  void* const little = std::malloc(kLittle);
  std::free(little);
  return little != nullptr;
}

void write_error(std::string_view text) noexcept {
  DWORD written = 0;
  WriteFile(GetStdHandle(STD_ERROR_HANDLE), text.data(), static_cast<DWORD>(text.size()), &written,
            nullptr);
}

/// "rtpm" of "C:\rtpm\bin\rtpm.exe", in `path`.
std::string_view name_in(std::string_view path) noexcept {
  const std::size_t begin = path.find_last_of("\\/") + 1;
  const std::string_view name = path.substr(begin);
  return name.substr(0, name.rfind('.'));
}

// The code page that the console had, which other programs in it go on with.
UINT code_page_before = 0;

void restore_code_page() noexcept {
  SetConsoleOutputCP(code_page_before);
}

}  // namespace

void print_last_error(std::string_view first, std::string_view second,
                      std::string_view third) noexcept {
  std::array<char, kPathSizeMax> path{};
  const DWORD size = GetModuleFileNameA(nullptr, path.data(), kPathSizeMax);
  write_error(name_in({path.data(), size}));
  for (const std::string_view part : {std::string_view(": "), first, second, third}) {
    write_error(part);
  }
  write_error("\n");
}

void end_process(int code) noexcept {
  _exit(code);
}

bool is_out_of_memory() noexcept {
  const std::exception_ptr thrown = std::current_exception();
  if (thrown == nullptr) return !has_memory();
  try {
    std::rethrow_exception(thrown);
  } catch (const std::bad_alloc&) {
    return true;
  } catch (...) {
    return false;
  }
}

std::string_view memory_remedy() noexcept {
  return "close other programs or enlarge the paging file, or configure less.";
}

void set_up_streams() noexcept {
  // Bytes go out as they are: texts are UTF-8 with line feeds, and recordings go through pipes.
  for (const int stream : {0, 1, 2}) {
    _setmode(stream, _O_BINARY);
  }
  code_page_before = GetConsoleOutputCP();
  if (code_page_before == 0 || code_page_before == CP_UTF8) return;
  if (SetConsoleOutputCP(CP_UTF8) != 0) std::atexit(restore_code_page);
}

void write_line_feed() noexcept {
  static_cast<void>(!_write(_fileno(stdout), "\n", 1));
}

}  // namespace rtpm::program::os
