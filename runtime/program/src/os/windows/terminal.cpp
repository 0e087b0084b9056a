#include "os/terminal.hpp"

#include <io.h>
#include <windows.h>

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <string>
#include <thread>

namespace rtpm::program::os {
namespace {

/// Blocks for bytes of standard input: those of a console as UTF-8, whatever its code page is.
/// @return empty at the end
std::string read_some(HANDLE file) {
  constexpr DWORD kSize = 1024;
  DWORD mode = 0;
  DWORD count = 0;
  if (GetConsoleMode(file, &mode) != 0) {
    std::array<wchar_t, kSize> text{};
    if (ReadConsoleW(file, text.data(), kSize, &count, nullptr) == 0) return {};
    std::array<char, 4 * kSize> bytes{};
    const int size =
        WideCharToMultiByte(CP_UTF8, 0, text.data(), static_cast<int>(count), bytes.data(),
                            static_cast<int>(bytes.size()), nullptr, nullptr);
    return {bytes.data(), static_cast<std::size_t>(size)};
  }
  std::array<char, kSize> bytes{};
  if (ReadFile(file, bytes.data(), kSize, &count, nullptr) == 0) return {};
  return {bytes.data(), count};
}

}  // namespace

// Windows can't wait for a line of a console or for bytes of a pipe with a time-out, so a thread
// blocks for them. It holds the state that its reader may have left, and ends with the input or
// with the process.
class Input {
 public:
  static std::shared_ptr<Input> start() {
    const auto input = std::make_shared<Input>();
    const auto file = reinterpret_cast<HANDLE>(_get_osfhandle(_fileno(stdin)));
    std::thread([input, file] {
      while (input->put(read_some(file))) {
      }
    }).detach();
    return input;
  }

  std::optional<InputEnd> take(Duration patience, std::string& to) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, patience, [&] { return is_at_end_ || !text_.empty(); });
    if (text_.empty()) return is_at_end_ ? InputEnd::kEnd : InputEnd::kNone;
    std::erase(text_, '\r');
    to += text_;
    text_.clear();
    changed_.notify_all();
    return std::nullopt;
  }

 private:
  /// @return whether to go on; not before the text is taken, so that a fast writer has to wait
  bool put(std::string text) {
    std::unique_lock lock(mutex_);
    is_at_end_ = text.empty();
    text_ = std::move(text);
    changed_.notify_all();
    changed_.wait(lock, [&] { return text_.empty(); });
    return !is_at_end_;
  }

  std::mutex mutex_{};
  std::condition_variable changed_{};
  std::string text_{};
  bool is_at_end_ = false;
};

std::size_t terminal_width() noexcept {
  CONSOLE_SCREEN_BUFFER_INFO found{};
  if (GetConsoleScreenBufferInfo(GetStdHandle(STD_OUTPUT_HANDLE), &found) == 0) return 0;
  return static_cast<std::size_t>(found.srWindow.Right - found.srWindow.Left + 1);
}

std::optional<InputEnd> read_input(std::shared_ptr<Input>& input, Duration patience,
                                   std::string& to) {
  if (!input) input = Input::start();
  return input->take(patience, to);
}

}  // namespace rtpm::program::os
