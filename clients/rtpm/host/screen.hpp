#pragma once

#include <string>

#include "host/top_picture.hpp"

namespace rtpm::tool {

/// The whole terminal, by ncurses.
/// @ownership one per program
/// @threads  one
class Screen {
 public:
  Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;
  /// Gives the terminal back as it was.
  ~Screen();

  /// Shows the picture, as much as there is room for; `footer` is the last line.
  void show(const TopPicture& picture, const std::string& header, const std::string& footer);
  /// A key that was pressed, within `time`; 0: none.
  [[nodiscard]] int key(Duration time);
};

}  // namespace rtpm::tool
