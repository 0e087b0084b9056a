#include "picture.hpp"

#include <array>
#include <cmath>
#include <fstream>

#include "rtpm/program/text.hpp"

namespace rtpm::scene {
namespace {

using program::formatted;

constexpr double kPixelsPerMm = 4.8;
constexpr double kWidth = kPanelWidthMm * kPixelsPerMm;
constexpr double kHeight = kPanelHeightMm * kPixelsPerMm;
constexpr double kMargin = 46;
constexpr double kTitleHeight = 34;
constexpr double kFootHeight = 92;
constexpr double kGridMm = 10;

/// The shortest force that gets an arrow head; forces towards the viewer are shorter.
constexpr double kHeadedMm = 2.5;
constexpr double kPointStepMm = 0.3;

constexpr const char* kArrowHead = " marker-end=\"url(#head)\"";
struct Style {
  const char* colour;
  const char* width;
  const char* more;
  const char* name;  ///< The name in the legend.
};
constexpr std::array<Style, kInkCount> kStyles{{
    {"#6b7685", "1.6", "", "scene"},
    {"#d97706", "1.4", "", "device"},
    {"#1d4ed8", "2.4", "", "proxy"},
    {"#dc2626", "0.8", " stroke-opacity=\"0.55\"", ""},
    {"#dc2626", "1.7", kArrowHead, "force, 3 mm per newton"},
}};

std::string escaped(std::string_view raw) {
  std::string safe;
  for (const char byte : raw) {
    switch (byte) {
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '&':
        safe += "&amp;";
        break;
      case '"':
        safe += "&quot;";
        break;
      default:
        safe += static_cast<unsigned char>(byte) < 0x20 ? ' ' : byte;
    }
  }
  return safe;
}

double distance_mm(const Point& a, const Point& b) {
  return std::hypot(a.right_mm - b.right_mm, a.up_mm - b.up_mm);
}

/// Omits points that coincide with the previous one.
std::string coordinates(const Panel& panel, const std::vector<Point>& points) {
  std::string list;
  const Point* before = nullptr;
  for (const Point& point : points) {
    const bool is_needed = before == nullptr || &point == &points.back() ||
                           distance_mm(*before, point) >= kPointStepMm;
    if (!is_needed) continue;
    before = &point;
    list += formatted("%s%.1f,%.1f", list.empty() ? "" : " ",
                      (point.right_mm - panel.low.right_mm) * kPixelsPerMm,
                      (panel.low.up_mm + kPanelHeightMm - point.up_mm) * kPixelsPerMm);
  }
  return list;
}

std::string line_text(const Panel& panel, const Line& line) {
  if (line.points.size() < 2) return {};
  const Style& style = kStyles[static_cast<std::size_t>(line.ink)];
  const bool is_short =
      line.ink == Ink::kForce && distance_mm(line.points.front(), line.points.back()) < kHeadedMm;
  return formatted("<polyline stroke=\"%s\" stroke-width=\"%s\"%s points=\"", style.colour,
                   style.width, is_short ? "" : style.more) +
         coordinates(panel, line.points) + "\"/>\n";
}

/// A grid line every 10 mm, a number every 20 mm.
std::string grid_text(const Panel& panel) {
  std::string grid;
  const auto first = [](double low_mm) {
    return static_cast<int>((low_mm < 0 ? low_mm : low_mm + kGridMm) / kGridMm) *
           static_cast<int>(kGridMm);
  };
  for (int mm = first(panel.low.right_mm); mm <= panel.low.right_mm + kPanelWidthMm; mm += 10) {
    const double x = (mm - panel.low.right_mm) * kPixelsPerMm;
    grid += formatted("<path class=\"grid\" d=\"M%.1f 0V%.1f\"/>\n", x, kHeight);
    if (mm % 20 == 0) {
      grid += formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%d</text>\n", x,
                        kHeight + 16, mm);
    }
  }
  for (int mm = first(panel.low.up_mm); mm <= panel.low.up_mm + kPanelHeightMm; mm += 10) {
    const double y = (panel.low.up_mm + kPanelHeightMm - mm) * kPixelsPerMm;
    grid += formatted("<path class=\"grid\" d=\"M0 %.1fH%.1f\"/>\n", y, kWidth);
    if (mm % 20 == 0) {
      grid += formatted("<text x=\"-6\" y=\"%.1f\" text-anchor=\"end\">%d</text>\n", y + 4, mm);
    }
  }
  return grid;
}

std::string panel_text(const Panel& panel, double left) {
  std::string svg = formatted("<g transform=\"translate(%.0f %.0f)\">\n", left, kTitleHeight);
  svg += formatted("<text x=\"0\" y=\"-10\" class=\"title\">%s</text>\n", panel.title.c_str());
  svg += formatted("<text x=\"%.0f\" y=\"%.0f\" text-anchor=\"end\">%s / mm</text>\n", kWidth,
                   kHeight + 32, panel.right_axis.c_str());
  svg +=
      formatted("<text x=\"-6\" y=\"-10\" text-anchor=\"end\">%s</text>\n", panel.up_axis.c_str());
  svg += grid_text(panel);
  svg += "<g clip-path=\"url(#window)\" fill=\"none\" stroke-linejoin=\"round\">\n";
  if (!panel.solid.empty()) {
    svg += "<polygon fill=\"#94a3b8\" fill-opacity=\"0.35\" points=\"" +
           coordinates(panel, panel.solid) + "\"/>\n";
  }
  for (const Line& line : panel.lines)
    svg += line_text(panel, line);
  return svg + "</g>\n" +
         formatted(
             "<rect width=\"%.0f\" height=\"%.0f\" fill=\"none\" stroke=\"#334155\"/>\n</g>\n",
             kWidth, kHeight);
}

std::string legend_text(double y) {
  std::string svg;
  double x = kMargin;
  for (const Style& style : kStyles) {
    if (*style.name == '\0') continue;
    svg += formatted("<path d=\"M%.0f %.0fh30\" stroke=\"%s\" stroke-width=\"%s\"%s/>\n", x, y,
                     style.colour, style.width, style.more);
    svg += formatted("<text x=\"%.0f\" y=\"%.0f\">%s</text>\n", x + 42, y + 4, style.name);
    x += 130;
  }
  return svg;
}

}  // namespace

std::string svg_text(std::span<const Panel> panels, std::string_view caption) {
  const double width = kMargin + static_cast<double>(panels.size()) * (kWidth + kMargin);
  const double height = kTitleHeight + kHeight + kFootHeight;
  std::string svg = formatted(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" "
      "width=\"%.0f\" height=\"%.0f\">\n",
      width, height, width, height);
  svg +=
      "<style>text{font:12px sans-serif;fill:#334155}.title{font-weight:bold}"
      ".grid{stroke:#e2e8f0}</style>\n"
      "<defs><marker id=\"head\" viewBox=\"0 0 8 8\" refX=\"6\" refY=\"4\" markerWidth=\"4.5\" "
      "markerHeight=\"4.5\" orient=\"auto\"><path d=\"M0 0L8 4L0 8z\" "
      "fill=\"#dc2626\"/></marker>\n";
  svg += formatted(
      "<clipPath id=\"window\"><rect width=\"%.0f\" height=\"%.0f\"/></clipPath></defs>\n", kWidth,
      kHeight);
  svg += "<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n";
  double left = kMargin;
  for (const Panel& panel : panels) {
    svg += panel_text(panel, left);
    left += kWidth + kMargin;
  }
  const double foot = kTitleHeight + kHeight;
  svg += legend_text(foot + 54);
  svg += formatted("<text x=\"%.0f\" y=\"%.0f\">", kMargin, foot + 80) + escaped(caption) +
         "</text>\n";
  return svg + "</svg>\n";
}

expected<void, SetupError> write_file(const std::string& path, std::string_view svg) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(svg.data(), static_cast<std::streamsize>(svg.size()));
  file.close();
  if (file) return {};
  return setup_error("the picture " + path + " can't be written", "",
                     "name a file in a folder that you may write to");
}

}  // namespace rtpm::scene
