#pragma once

#include <string>

#include "host/top_picture.hpp"

namespace rtpm::tool {

/// The whole terminal, through ncurses.
/// @ownership one per program
/// @threads  one
class Screen {
 public:
  Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;
  /// Restores the terminal.
  ~Screen();

  /// Shows as much of the picture as fits; `footer` is the last line.
  void show(const TopPicture& picture, const std::string& header, const std::string& footer);
  /// Waits up to `time` for a key; 0 if none was pressed.
  [[nodiscard]] int key(Duration time);
};

}  // namespace rtpm::tool
