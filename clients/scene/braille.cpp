#include "braille.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace rtpm::scene {
namespace {

constexpr std::size_t kDotsAcross = 2;
constexpr std::size_t kDotsDown = 4;
/// The dots, indexed by row and column within a character.
/// @source   Unicode, block Braille Patterns
constexpr std::array<std::array<std::uint8_t, kDotsAcross>, kDotsDown> kDotBits{
    {{0x01, 0x08}, {0x02, 0x10}, {0x04, 0x20}, {0x40, 0x80}}};
/// Colour codes by ink: grey, yellow, green, dark red, bright red.
constexpr std::array<const char*, kInkCount> kColours{"90", "33", "92", "31", "91"};

struct Cell {
  std::uint8_t dots = 0;
  Ink ink = Ink::kSolid;
};

class Canvas {
 public:
  Canvas(const Panel& panel, std::size_t columns, std::size_t rows)
      : panel_(panel), columns_(columns), rows_(rows), cells_(columns * rows) {}

  void fill(const std::vector<Point>& polygon) {
    if (polygon.empty()) return;
    for (std::size_t y = 1; y < rows_ * kDotsDown; y += kDotsDown) {
      // Fills every other column of each fourth row, so that lines stay visible.
      for (std::size_t x = y / kDotsDown % 2; x < columns_ * kDotsAcross; x += kDotsAcross) {
        if (is_inside(polygon, point_at(x, y))) set(x, y, Ink::kSolid);
      }
    }
  }

  void draw(const Line& line) {
    if (line.points.size() == 1) draw(line.ink, line.points[0], line.points[0]);
    for (std::size_t i = 1; i < line.points.size(); ++i)
      draw(line.ink, line.points[i - 1], line.points[i]);
  }

  [[nodiscard]] std::vector<std::string> texts(bool has_colour) const {
    std::vector<std::string> texts;
    for (std::size_t row = 0; row < rows_; ++row) {
      std::string& text = texts.emplace_back();
      for (std::size_t column = 0; column < columns_; ++column)
        add(text, cells_[row * columns_ + column], has_colour);
      if (has_colour) text += "\033[0m";
    }
    return texts;
  }

 private:
  [[nodiscard]] double dot_right(double mm) const noexcept {
    return (mm - panel_.low.right_mm) / kPanelWidthMm * static_cast<double>(columns_ * kDotsAcross);
  }
  [[nodiscard]] double dot_down(double mm) const noexcept {
    return (panel_.low.up_mm + kPanelHeightMm - mm) / kPanelHeightMm *
           static_cast<double>(rows_ * kDotsDown);
  }
  /// The centre of a dot.
  [[nodiscard]] Point point_at(std::size_t x, std::size_t y) const noexcept {
    return {panel_.low.right_mm + (static_cast<double>(x) + 0.5) * kPanelWidthMm /
                                      static_cast<double>(columns_ * kDotsAcross),
            panel_.low.up_mm + kPanelHeightMm -
                (static_cast<double>(y) + 0.5) * kPanelHeightMm /
                    static_cast<double>(rows_ * kDotsDown)};
  }

  /// Uses the even-odd rule.
  [[nodiscard]] static bool is_inside(const std::vector<Point>& polygon, const Point& at) noexcept {
    bool is_in = false;
    for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
      const Point& a = polygon[i];
      const Point& b = polygon[j];
      if ((a.up_mm > at.up_mm) == (b.up_mm > at.up_mm)) continue;
      const double cross_mm =
          a.right_mm + (at.up_mm - a.up_mm) / (b.up_mm - a.up_mm) * (b.right_mm - a.right_mm);
      if (at.right_mm < cross_mm) is_in = !is_in;
    }
    return is_in;
  }

  void draw(Ink ink, const Point& from, const Point& to) {
    const double x = dot_right(from.right_mm);
    const double y = dot_down(from.up_mm);
    const double across = dot_right(to.right_mm) - x;
    const double down = dot_down(to.up_mm) - y;
    // A longer line leaves the window anyway.
    const double step_count_max = 4.0 * static_cast<double>(columns_ + rows_) * kDotsDown;
    const int step_count = static_cast<int>(
        std::min(std::ceil(std::max(std::abs(across), std::abs(down))), step_count_max));
    for (int step = 0; step <= step_count; ++step) {
      const double share = step_count > 0 ? static_cast<double>(step) / step_count : 0;
      set_at(x + share * across, y + share * down, ink);
    }
  }
  void set_at(double x, double y, Ink ink) {
    const bool is_in_window = x >= 0 && x < static_cast<double>(columns_ * kDotsAcross) && y >= 0 &&
                              y < static_cast<double>(rows_ * kDotsDown);
    if (is_in_window) set(static_cast<std::size_t>(x), static_cast<std::size_t>(y), ink);
  }
  void set(std::size_t x, std::size_t y, Ink ink) {
    Cell& cell = cells_[y / kDotsDown * columns_ + x / kDotsAcross];
    cell.dots |= kDotBits[y % kDotsDown][x % kDotsAcross];
    cell.ink = ink;
  }

  static void add(std::string& text, const Cell& cell, bool has_colour) {
    if (has_colour)
      text += std::string("\033[") + kColours[static_cast<std::size_t>(cell.ink)] + "m";
    // Encodes U+2800 + dots in UTF-8.
    text += '\xe2';
    text += static_cast<char>(0xa0 | cell.dots >> 6);
    text += static_cast<char>(0x80 | (cell.dots & 0x3f));
  }

  const Panel& panel_;
  std::size_t columns_;
  std::size_t rows_;
  std::vector<Cell> cells_;
};

}  // namespace

std::vector<std::string> braille_rows(const Panel& panel, std::size_t columns, std::size_t rows,
                                      bool has_colour) {
  Canvas canvas(panel, columns, rows);
  canvas.fill(panel.solid);
  for (const Line& line : panel.lines)
    canvas.draw(line);
  return canvas.texts(has_colour);
}

}  // namespace rtpm::scene
