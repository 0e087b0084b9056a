#include "host/screen.hpp"

#include <ncurses.h>
#include <clocale>

namespace rtpm::tool {
namespace {

/// Writes a row if it fits the screen; returns the next row.
int put(int line, const std::string& text, attr_t attributes = A_NORMAL) {
  if (line >= LINES - 1) return line;
  attron(static_cast<int>(attributes));
  mvaddnstr(line, 0, text.c_str(), -1);
  attroff(static_cast<int>(attributes));
  return line + 1;
}

int put_table(int line, const std::vector<std::string>& rows) {
  for (std::size_t i = 0; i < rows.size(); ++i)
    line = put(line, rows[i], i == 0 ? A_BOLD : A_NORMAL);
  return line + 1;
}

}  // namespace

Screen::Screen() {
  std::setlocale(LC_ALL, "");
  ::initscr();
  ::cbreak();
  ::noecho();
  ::keypad(stdscr, TRUE);
  ::curs_set(0);
}

Screen::~Screen() {
  ::endwin();
}

void Screen::show(const TopPicture& picture, const std::string& header, const std::string& footer) {
  erase();
  int line = put(0, header, A_BOLD);
  line = put(line, picture.summary) + 1;
  line = put_table(line, picture.lanes);
  put_table(line, picture.devices);
  attron(A_REVERSE);
  mvhline(LINES - 1, 0, ' ', COLS);
  mvaddnstr(LINES - 1, 0, footer.c_str(), COLS);
  attroff(A_REVERSE);
  refresh();
}

int Screen::key(Duration time) {
  timeout(static_cast<int>(std::chrono::duration_cast<std::chrono::milliseconds>(time).count()));
  const int pressed = getch();
  return pressed == ERR ? 0 : pressed;
}

}  // namespace rtpm::tool
